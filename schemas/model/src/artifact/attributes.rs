//! What all kinds of artifacts share.

/// A kind of artifact by its attributes.
pub trait Attributes:
    serde::Serialize + serde::de::DeserializeOwned + schemars::JsonSchema
{
    /// The name of the kind, as the manifests of plugins have it.
    const KIND: &'static str;
}
