use std::sync::Arc;

use super::LoadError;
use crate::primitive::SavedPrimitive;
use crate::{TriangleBvh, WideBvh};

/// A bottom-level BVH that a TLAS can save and load.
///
/// An enum of several kinds writes a byte for the kind, then the bytes of the BVH.
pub trait SaveBlas: Sized {
    /// Why bytes are not such a BVH.
    type Error;

    /// The BVH as bytes.
    fn to_bytes(&self) -> Vec<u8>;

    /// The BVH that [`SaveBlas::to_bytes`] wrote.
    ///
    /// # Errors
    /// Bytes that it did not write: they may come from anywhere.
    fn from_bytes(bytes: &[u8]) -> Result<Self, Self::Error>;
}

impl SaveBlas for TriangleBvh {
    type Error = LoadError;

    fn to_bytes(&self) -> Vec<u8> {
        Self::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        Self::from_bytes(bytes)
    }
}

impl<P: SavedPrimitive> SaveBlas for WideBvh<P> {
    type Error = LoadError;

    fn to_bytes(&self) -> Vec<u8> {
        Self::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        Self::from_bytes(bytes)
    }
}

impl<B: SaveBlas> SaveBlas for Box<B> {
    type Error = B::Error;

    fn to_bytes(&self) -> Vec<u8> {
        B::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, B::Error> {
        B::from_bytes(bytes).map(Self::new)
    }
}

impl<B: SaveBlas> SaveBlas for Arc<B> {
    type Error = B::Error;

    fn to_bytes(&self) -> Vec<u8> {
        B::to_bytes(self)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, B::Error> {
        B::from_bytes(bytes).map(Self::new)
    }
}
