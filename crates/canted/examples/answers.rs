//! Writes the answers of all queries on a mesh as raw words, so that bindings can be compared with the library bit for bit.
//!
//! `answers INPUT OUTPUT`; both files are 32-bit words, least byte first. Input: numbers of vertices, triangles, rays and points;
//! vertices; indices; rays (origin, direction, `t_min`, `t_max`); points. Output: the closest hits of all rays; whether they are occluded;
//! the number of all hits, and these with their rays; the same for crossings; whether points are inside; the nearest point
//! of each (distance, triangle, position); signed distances. A hit is `t, u, v`, triangle, front side; a miss is `inf, 0, 0, -1, 0`.
use std::{env, error::Error, fs};

use canted::{Config, Hit, NearestPoint, PrimId, Ray, Side, TriangleBvh};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [input, output] = &arguments[..] else { return Err("usage: answers INPUT OUTPUT".into()) };
    let bytes = fs::read(input)?;
    let words: Vec<u32> = bytes.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
    let answers = answers(&words).ok_or_else(|| format!("{input}: the file ends too early"))??;
    fs::write(output, answers.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())?;
    Ok(())
}

/// The words of the output; `None` where the input ends too early.
fn answers(words: &[u32]) -> Option<Result<Vec<u32>, canted::GeometryError>> {
    let (&[n_vertices, n_triangles, n_rays, n_points], rest) = words.split_first_chunk()?;
    let (vertices, rest) = rest.split_at_checked(3 * n_vertices as usize)?;
    let (triangles, rest) = rest.split_at_checked(3 * n_triangles as usize)?;
    let (rays, points) = rest.split_at_checked(8 * n_rays as usize)?;
    let points = points.get(..3 * n_points as usize)?;
    let floats = |words: &[u32; 3]| words.map(f32::from_bits);
    let vertices: Vec<[f32; 3]> = vertices.as_chunks().0.iter().map(floats).collect();
    let points: Vec<[f32; 3]> = points.as_chunks().0.iter().map(floats).collect();
    let rays: Vec<Ray> = rays.as_chunks::<8>().0.iter().map(ray).collect();
    let bvh = TriangleBvh::build(&vertices, triangles.as_chunks().0, &Config::default());
    Some(bvh.map(|bvh| of_bvh(&bvh, &rays, &points)))
}

fn ray(words: &[u32; 8]) -> Ray {
    let [ox, oy, oz, dx, dy, dz, t_min, t_max] = words.map(f32::from_bits);
    Ray { origin: [ox, oy, oz], direction: [dx, dy, dz], t_min, t_max }
}

fn of_bvh(bvh: &TriangleBvh, rays: &[Ray], points: &[[f32; 3]]) -> Vec<u32> {
    let mut out = vec![];
    let mut closest = vec![None; rays.len()];
    bvh.par_closest_hits(rays, &mut closest);
    closest.iter().for_each(|hit| out.extend(row(hit.as_ref())));
    let mut occluded = vec![false; rays.len()];
    bvh.par_occluded_many(rays, &mut occluded);
    out.extend(occluded.iter().map(|&occluded| u32::from(occluded)));
    lists(&mut out, rays, |ray, hits| bvh.all_hits(ray, hits));
    lists(&mut out, rays, |ray, hits| bvh.crossings(ray, hits));
    out.extend(points.iter().map(|&point| u32::from(bvh.contains(point))));
    let none = NearestPoint { distance: f32::INFINITY, position: [f32::NAN; 3], primitive: PrimId(u32::MAX) };
    for &point in points {
        let nearest = bvh.nearest_point(point, f32::INFINITY).unwrap_or(none);
        out.extend([nearest.distance.to_bits(), nearest.primitive.0]);
        out.extend(nearest.position.map(f32::to_bits));
    }
    out.extend(points.iter().map(|&point| bvh.signed_distance(point).to_bits()));
    out
}

fn row(hit: Option<&Hit>) -> [u32; 5] {
    let miss = [f32::INFINITY.to_bits(), 0, 0, u32::MAX, 0];
    hit.map_or(miss, |hit| {
        [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive.0, u32::from(hit.side == Side::Front)]
    })
}

fn lists(out: &mut Vec<u32>, rays: &[Ray], mut query: impl FnMut(&Ray, &mut Vec<Hit>)) {
    let (place, mut n, mut hits) = (out.len(), 0, vec![]);
    out.push(0);
    for (i, ray) in (0..).zip(rays) {
        query(ray, &mut hits);
        n += hits.len();
        hits.iter().for_each(|hit| {
            out.push(i);
            out.extend(row(Some(hit)));
        });
    }
    out[place] = u32::try_from(n).expect("fewer hits than words");
}
