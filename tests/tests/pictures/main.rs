//! Pictures: compared with another renderer's, and the same bytes for any number of threads, tile size, volumes and builder.

mod oracle;
mod scenes;
mod threads;
