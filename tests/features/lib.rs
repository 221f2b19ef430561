//! Nothing: the manifest states features.
