//! Hashes of a model's document and of each of its tensors, which Python writes beside the tensors: bits that have
//! turned on a disk are found.

use std::collections::HashMap;
use std::path::Path;

use safetensors::SafeTensors;
use xxhash_rust::xxh3::xxh3_128;

use crate::ModelError;

/// What the names of hashes begin with; the tensor's name follows.
const PREFIX: &str = "hash.";
/// The name of the document's hash.
const DOCUMENT: &str = "hash.model.json";

/// Whether the tensors' file has hashes; refuses a document or a tensor that is not what was written.
pub fn verify(
    bytes: &[u8],
    path: &Path,
    document_path: &Path,
    document: &[u8],
) -> Result<bool, ModelError> {
    let unreadable = |error: safetensors::SafeTensorError| ModelError::Tensors {
        path: path.to_owned(),
        reason: error.to_string(),
    };
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(unreadable)?;
    let empty = HashMap::new();
    let stated = header.metadata().as_ref().unwrap_or(&empty);
    if !stated.keys().any(|name| name.starts_with(PREFIX)) {
        return Ok(false);
    }
    let compare = |path: &Path, what: &str, name: &str, found: String| match stated.get(name) {
        Some(stated) if *stated == found => Ok(()),
        stated => Err(ModelError::Damaged {
            path: path.to_owned(),
            what: what.to_owned(),
            found,
            stated: stated.cloned().unwrap_or_else(|| "none".to_owned()),
        }),
    };
    compare(document_path, "the document", DOCUMENT, hex(document))?;
    for (name, tensor) in SafeTensors::deserialize(bytes).map_err(unreadable)?.tensors() {
        // Name, type and shape belong to it.
        let head = format!("{name} {} {:?}\n", tensor.dtype(), tensor.shape());
        let whole = [head.as_bytes(), tensor.data()].concat();
        compare(path, &format!("tensor {name}"), &format!("{PREFIX}{name}"), hex(&whole))?;
    }
    Ok(true)
}

fn hex(bytes: &[u8]) -> String {
    format!("{:032x}", xxh3_128(bytes))
}
