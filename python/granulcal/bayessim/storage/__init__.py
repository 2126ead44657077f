"""A trained model on disk: a folder of JSON and tensors, with a hash of each part."""
