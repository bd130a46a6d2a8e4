//! Measures closest hits on a mesh, so that bindings can be compared with the library.
//!
//! `rate INPUT` reads the input of the example `answers`, builds a BVH as bindings do, and for each line of standard input casts all
//! rays once on all threads and prints the seconds of wall time that this took and the number of rays that hit.
#![expect(clippy::print_stdout, reason = "the program that measures reads the results")]
use std::{env, error::Error, fs, io, time::Instant};

use canted::{Config, Ray, TriangleBvh};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [input] = &arguments[..] else { return Err("usage: rate INPUT".into()) };
    let bytes = fs::read(input)?;
    let words: Vec<u32> = bytes.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
    let (vertices, triangles, rays) = parts(&words).ok_or_else(|| format!("{input}: the file ends too early"))?;
    let vertices: Vec<[f32; 3]> = vertices.as_chunks().0.iter().map(|v: &[u32; 3]| v.map(f32::from_bits)).collect();
    let bvh: TriangleBvh = TriangleBvh::build(&vertices, triangles.as_chunks().0, &Config::default())?;
    let rays: Vec<Ray> = rays.as_chunks().0.iter().map(ray).collect();
    let mut hits = vec![None; rays.len()];
    for line in io::stdin().lines() {
        line?;
        let start = Instant::now();
        bvh.par_closest_hits(&rays, &mut hits);
        let seconds = start.elapsed().as_secs_f64();
        println!("{seconds} {}", hits.iter().flatten().count());
    }
    Ok(())
}

/// Vertices, indices and rays of the input; `None` where it ends too early.
fn parts(words: &[u32]) -> Option<(&[u32], &[u32], &[u32])> {
    let (&[n_vertices, n_triangles, n_rays, _], rest) = words.split_first_chunk()?;
    let (vertices, rest) = rest.split_at_checked(3 * n_vertices as usize)?;
    let (triangles, rest) = rest.split_at_checked(3 * n_triangles as usize)?;
    Some((vertices, triangles, rest.get(..8 * n_rays as usize)?))
}

fn ray(words: &[u32; 8]) -> Ray {
    let [ox, oy, oz, dx, dy, dz, t_min, t_max] = words.map(f32::from_bits);
    Ray { origin: [ox, oy, oz], direction: [dx, dy, dz], t_min, t_max }
}
