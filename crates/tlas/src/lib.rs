//! tlas
