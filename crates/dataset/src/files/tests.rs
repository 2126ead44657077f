//! Files that are whole or absent, and what they replace.

use super::*;

#[test]
fn a_file_is_complete_or_absent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.json");
    let mut pending = PendingFile::create(&path, Form::Json).unwrap();
    pending.write_all(b"half").unwrap();
    assert!(!path.exists());
    drop(pending);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    write_file(&path, Form::Json, b"{}").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"{}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_folder_is_no_file_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let error = write_file(folder.path(), Form::Json, b"").unwrap_err();
    assert!(error.to_string().contains("a folder"));
    let missing = folder.path().join("no/such/file");
    assert!(write_file(&missing, Form::Json, b"").unwrap_err().is_bad_input());
}

#[test]
fn a_file_of_another_kind_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let scene = "name = \"mine\"\n[grains]\ncount = 3\n";
    for form in [
        Form::Npy,
        Form::Npz,
        Form::Png,
        Form::Mcap,
        Form::Checkpoint,
        Form::Parquet,
        Form::Safetensors,
        Form::ManifestToml,
        Form::CameraToml,
        Form::SensorToml,
        Form::Json,
        Form::Html,
        Form::Csv,
        Form::Pdf,
        Form::Svg,
        Form::Gif,
        Form::Mp4,
        Form::Bag,
        Form::Export,
    ] {
        fs::write(&path, scene).unwrap();
        let error = write_file(&path, form, b"x").unwrap_err();
        assert!(matches!(error, DatasetError::Replaces { .. }), "{form:?}: {error}");
        assert!(error.is_bad_input());
        assert_eq!(fs::read_to_string(&path).unwrap(), scene);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn of_what_people_and_cameras_make_only_what_granulcal_wrote_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let kept = |name: &str, form: Form, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let error = write_file(&path, form, b"x").unwrap_err();
        assert!(matches!(error, DatasetError::Replaces { .. }), "{name}: {error}");
        assert_eq!(fs::read(&path).unwrap(), bytes, "{name}");
        error.to_string()
    };
    let png = b"\x89PNG\r\n\x1a\n-pixels-\0\0\0\0IEND\xaeB`\x82";
    let (gif, pdf, svg) = (b"GIF89a-pixels-;", b"%PDF-1.4\n%%EOF\n", b"<svg></svg>\n");
    let (mp4, npz) = (b"\0\0\0\x08ftyp", b"PK\x05\x06-end-of-arrays-\0\0");
    let files: [(&str, Form, &[u8]); 6] = [
        ("a.png", Form::Png, png),
        ("a.gif", Form::Gif, gif),
        ("a.pdf", Form::Pdf, pdf),
        ("a.svg", Form::Svg, svg),
        ("a.mp4", Form::Mp4, mp4),
        ("a.npz", Form::Npz, npz),
    ];
    for (name, form, bytes) in files {
        assert!(kept(name, form, bytes).contains("granulcal did not write"), "{name}");
        let own = folder.path().join(format!("own-{name}"));
        write_file(&own, form, bytes).unwrap();
        write_file(&own, form, bytes).unwrap();
        let mut changed = fs::read(&own).unwrap();
        changed[5] ^= 1;
        kept(&format!("own-{name}"), form, &changed);
    }
    assert!(kept("a.html", Form::Html, b"<!doctype html>Mine").contains("did not write"));
    let own = folder.path().join("own.html");
    write_file(&own, Form::Html, b"<!doctype html>Made by granulcal 0.1.0").unwrap();
    write_file(&own, Form::Html, b"<!doctype html>Made by granulcal 0.2.0").unwrap();
    assert!(kept("a.bag", Form::Bag, b"#ROSBAG V2.0\n").contains("may not be had again"));
    assert!(kept("a.mcap", Form::Mcap, b"\x89MCAP0\r\n").contains("no film of a pour"));
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_devices_devices() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let (real, link) = (folder.path().join("real.json"), folder.path().join("link.json"));
    fs::write(&real, "{}").unwrap();
    symlink(&real, &link).unwrap();
    write_file(&link, Form::Json, b"[1]").unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read(&real).unwrap(), b"[1]");
    let lost = folder.path().join("lost.json");
    symlink(folder.path().join("nowhere"), &lost).unwrap();
    let error = write_file(&lost, Form::Json, b"").unwrap_err().to_string();
    assert!(error.contains("leads nowhere"), "{error}");
    let error = write_file(Path::new("/dev/null"), Form::Json, b"").unwrap_err().to_string();
    assert!(error.contains("a device"), "{error}");
    let error = read(Path::new("/dev/zero")).unwrap_err().to_string();
    assert!(error.contains("a device") && error.contains("plain file"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_temporary_file_of_somebody_else_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let secret = folder.path().join("secret");
    fs::write(&secret, "s").unwrap();
    let pid = std::process::id();
    let planted = folder.path().join(format!(".a.json.{pid}-0{TEMPORARY}"));
    std::os::unix::fs::symlink(&secret, &planted).unwrap();
    write_file(&folder.path().join("a.json"), Form::Json, b"{}").unwrap();
    assert_eq!(fs::read_to_string(&secret).unwrap(), "s");
    assert!(fs::symlink_metadata(&planted).unwrap().is_symlink());
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_process_has_left_goes_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let mut killed = std::process::Command::new("true").spawn().unwrap();
    let (own, dead) = (std::process::id(), killed.id());
    killed.wait().unwrap();
    let left = format!(".a.json.{dead}-0{TEMPORARY}");
    let kept = [
        format!(".a.json.{own}-5{TEMPORARY}"),
        format!(".a.json.1-0{TEMPORARY}"),
        format!(".b.json.{dead}-0{TEMPORARY}"),
        format!("a.json.{dead}-0{TEMPORARY}"),
        format!(".a.json.{dead}-0.mine"),
        format!(".a.json.{dead}x-0{TEMPORARY}"),
    ];
    for name in kept.iter().chain([&left]) {
        let path = folder.path().join(name);
        fs::write(&path, "half").unwrap();
        let hour_ago = std::time::SystemTime::now() - std::time::Duration::from_secs(3600);
        File::options().write(true).open(&path).unwrap().set_modified(hour_ago).unwrap();
    }
    let young = folder.path().join(format!(".a.json.{dead}-7{TEMPORARY}"));
    fs::write(&young, "half").unwrap();
    let link = folder.path().join(format!(".a.json.{dead}-1{TEMPORARY}"));
    std::os::unix::fs::symlink(&left, &link).unwrap();
    write_file(&folder.path().join("a.json"), Form::Json, b"{}").unwrap();
    assert!(!folder.path().join(&left).exists());
    assert!(fs::symlink_metadata(&link).is_ok() && young.exists());
    for name in kept {
        assert!(folder.path().join(&name).exists(), "{name}");
    }
}

#[test]
fn a_file_that_is_read_only_stays_and_long_names_are_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.json");
    fs::write(&path, "{}").unwrap();
    let mut permissions = fs::metadata(&path).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&path, permissions).unwrap();
    let error = write_file(&path, Form::Json, b"[]").unwrap_err().to_string();
    assert!(error.contains("read-only"), "{error}");
    assert_eq!(fs::read(&path).unwrap(), b"{}");
    let long = folder.path().join(format!("{}.json", "n".repeat(250)));
    write_file(&long, Form::Json, b"[]").unwrap();
    assert_eq!(fs::read(&long).unwrap(), b"[]");
}

#[test]
fn what_is_too_large_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large");
    File::create(&path).unwrap().set_len(LARGEST_TEXT + 1).unwrap();
    let error = read_text(&path).unwrap_err().to_string();
    assert!(error.contains("at most"), "{error}");
}
