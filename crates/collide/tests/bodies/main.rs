//! Bodies against bodies, compared with loops over all pairs.

mod cast;
mod common;
mod distance;
mod pairs;
mod scene;
mod shapes;
mod sweep;
