//! The codecs of indices: triangles in the order of a vertex cache, and any sequence. Versions 0 and 1.

use super::{Flaw, Stream};

/// First bytes of the streams, without the version.
const TRIANGLES: u8 = 0xe0;
const SEQUENCE: u8 = 0xd0;

/// Bytes at the end of a stream of triangles: codes of frequent pairs of corners.
const N_PAIRS: usize = 16;
/// Bytes at the end of a sequence, of no meaning.
const N_PADDING: usize = 4;

/// The last 16 items.
struct Recent<T> {
    items: [T; 16],
    /// Where the next one goes.
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn new(item: T) -> Self {
        Self { items: [item; 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next] = item;
        self.next = (self.next + 1) % 16;
    }

    /// The item that was pushed `age` pushes before the last.
    fn get(&self, age: u8) -> T {
        self.items[(self.next + 15 - usize::from(age % 16)) % 16]
    }
}

/// The state of the codec of triangles.
struct Triangles<'a> {
    data: Stream<'a>,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
    /// The smallest index that did not occur yet.
    next: u32,
    /// The last index that was coded by itself.
    last: u32,
}

/// Decodes `count` indices, a multiple of 3.
pub(super) fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, Flaw> {
    let (mut data, version, pairs) = Stream::open(bytes, TRIANGLES, |_| N_PAIRS)?;
    let codes = data.take(count / 3)?;
    let (edges, vertices) = (Recent::new([u32::MAX; 2]), Recent::new(u32::MAX));
    let mut state = Triangles { data, edges, vertices, next: 0, last: 0 };
    let n_recent = if version == 0 { 15 } else { 13 };
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        indices.extend(match code {
            0..0xf0 => state.at_edge(code >> 4, code & 15, n_recent)?,
            0xf0..0xfe => state.new_pair(pairs[usize::from(code & 15)])?,
            0xfe.. => state.coded(code == 0xff)?,
        });
    }
    state.data.close()?;
    Ok(indices)
}

impl Triangles<'_> {
    /// A triangle at a recent edge.
    fn at_edge(&mut self, edge: u8, corner: u8, n_recent: u8) -> Result<[u32; 3], Flaw> {
        let [a, b] = self.edges.get(edge);
        let c = match corner {
            0 => self.fresh(),
            _ if corner < n_recent => self.vertices.get(corner),
            15 => self.free()?,
            // 13 and 14 are one less and one more than the last.
            _ => {
                self.last = self.last.wrapping_add(u32::from(corner) * 2).wrapping_sub(27);
                self.last
            }
        };
        if corner == 0 || corner >= n_recent {
            self.vertices.push(c);
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// A triangle with a new corner. `pair` are the codes of the two others, which are not in the data.
    fn new_pair(&mut self, pair: u8) -> Result<[u32; 3], Flaw> {
        let [b, c] = [pair >> 4, pair & 15];
        if b == 15 || c == 15 { Err("an index in the table of pairs") } else { self.corners(0, b, c) }
    }

    /// A triangle whose codes are in the data.
    fn coded(&mut self, is_free: bool) -> Result<[u32; 3], Flaw> {
        let pair = self.data.byte()?;
        if pair == 0 {
            self.next = 0;
        }
        self.corners(if is_free { 15 } else { 0 }, pair >> 4, pair & 15)
    }

    /// A triangle by codes of its corners: 0 for a new vertex, 15 for an index in the data, else a recent vertex.
    fn corners(&mut self, a: u8, b: u8, c: u8) -> Result<[u32; 3], Flaw> {
        let codes = [a, b, c];
        // New and recent ones first, before any is pushed.
        let mut corners = codes.map(|code| match code {
            0 => self.fresh(),
            _ => self.vertices.get(code - 1),
        });
        for (corner, code) in corners.iter_mut().zip(codes) {
            if code == 15 {
                *corner = self.free()?;
            }
        }
        for (corner, code) in corners.into_iter().zip(codes) {
            if code == 0 || code == 15 {
                self.vertices.push(corner);
            }
        }
        let [a, b, c] = corners;
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok(corners)
    }

    fn fresh(&mut self) -> u32 {
        let fresh = self.next;
        self.next = self.next.wrapping_add(1);
        fresh
    }

    /// An index in the data, as a difference from the last.
    fn free(&mut self) -> Result<u32, Flaw> {
        self.last = self.last.wrapping_add(signed(number(&mut self.data)?));
        Ok(self.last)
    }
}

/// Decodes a sequence of `count` indices.
pub(super) fn sequence(bytes: &[u8], count: usize) -> Result<Vec<u32>, Flaw> {
    let (mut data, _, _) = Stream::open(bytes, SEQUENCE, |_| N_PADDING)?;
    // Differences from one of two indices: that of each kind which came last.
    let mut last = [0_u32; 2];
    let index = |_| {
        let number = number(&mut data)?;
        let last = &mut last[(number & 1) as usize];
        *last = last.wrapping_add(signed(number >> 1));
        Ok(*last)
    };
    let indices = (0..count).map(index).collect::<Result<_, Flaw>>()?;
    data.close()?;
    Ok(indices)
}

/// A number of up to five bytes with seven bits each, the lowest first.
fn number(data: &mut Stream<'_>) -> Result<u32, Flaw> {
    let mut number = 0;
    for shift in [0, 7, 14, 21, 28] {
        let byte = data.byte()?;
        number |= u32::from(byte & 127) << shift;
        if byte < 128 {
            break;
        }
    }
    Ok(number)
}

/// A number whose lowest bit is the sign, as a two's complement.
fn signed(zigzag: u32) -> u32 {
    zigzag >> 1 ^ (zigzag & 1).wrapping_neg()
}
