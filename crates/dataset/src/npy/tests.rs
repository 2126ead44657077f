use super::*;

fn here() -> &'static Path {
    Path::new("a.npy")
}

fn parse(file: &Path, array: &str, mut bytes: &[u8]) -> Result<Array, DatasetError> {
    super::parse(file, array, &mut bytes, 1 << 20)
}

fn parse_text(file: &Path, array: &str, mut bytes: &[u8]) -> Result<String, DatasetError> {
    super::parse_text(file, array, &mut bytes)
}

fn custom(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dict = format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((dict.len() as u16).to_le_bytes());
    bytes.extend(dict.bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn arrays_and_words_survive() {
    let bytes = encode(&[2, 3], (0..6).map(f64::from));
    assert_eq!((bytes.len() - 48) % 64, 0);
    let array = parse(here(), "", &bytes).unwrap();
    assert_eq!(array, Array { shape: vec![2, 3], values: (0..6).map(f64::from).collect() });
    assert_eq!(parse(here(), "", &encode(&[], [7.0])).unwrap().shape, Vec::<usize>::new());
    assert_eq!(parse(here(), "", &encode(&[1], [7.0])).unwrap().shape, [1]);
    assert_eq!(parse_text(here(), "", &encode_text("mm")).unwrap(), "mm");
}

#[test]
fn other_orders_and_types_are_read() {
    let data: Vec<u8> = [1i16, -2, 3, 4, 5, 6].iter().flat_map(|v| v.to_be_bytes()).collect();
    let array = parse(here(), "", &custom("'>i2'", "True", "(2, 3)", &data)).unwrap();
    // Columns (1, -2), (3, 4), (5, 6).
    assert_eq!(array.values, [1.0, 3.0, 5.0, -2.0, 4.0, 6.0]);
    assert_eq!(parse_text(here(), "", &custom("'|S2'", "False", "()", b"mm")).unwrap(), "mm");
}

#[test]
fn faults_are_named() {
    let cases: [(Vec<u8>, &str); 11] = [
        (Vec::new(), "truncated after 0 bytes"),
        (custom("'<f8'", "False", "(131073,)", &[]), "at most 1048576 bytes as f64"),
        (custom("'<u1'", "True", "(65537,)", &[]), "at most 1048576 bytes as f64"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "at most 65536 bytes"),
        (b"not an array at all".to_vec(), "in .npy format"),
        (encode(&[2], [1.0, 2.0])[..20].to_vec(), "truncated after 20 bytes"),
        (encode(&[2], [1.0]), "16 bytes"),
        (custom("'<c16'", "False", "(1,)", &[0; 16]), "<c16"),
        (custom("[('x', '<f8')]", "False", "(1,)", &[0; 8]), "descr (one type)"),
        (custom("'<f8'", "False", "(99999999999, 99999999999)", &[]), "at most"),
        (custom("'<f8'", "False", "(-1,)", &[]), "shape"),
    ];
    for (bytes, expected) in cases {
        let error = parse(here(), "depth", &bytes).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("a.npy"), "{expected}: {error}");
    }
}
