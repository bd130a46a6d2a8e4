//! Molecules as balls and sticks: PDB and XYZ.
//!
//! Sources: wwPDB, *Protein Data Bank Contents Guide*, version 3.30 (records MODEL, ATOM, HETATM, CONECT); XYZ as Open Babel documents it.
//!
//! Atoms come first, in the order of the file, as balls of half the covalent radius, so that bonds are seen. Bonds follow as sticks: those of
//! CONECT in their order, then those between atoms of which one at least has no CONECT, whose distance is at most the sum of
//! their covalent radii plus [`BOND_TOLERANCE`], as Open Babel decides. Units are ångströms. Of several models the first is read.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::elements::{Element, MAX_COVALENT_RADIUS};
use super::{Strands, point_index};
use crate::read::error::ReadError;
use crate::read::input::ReadOptions;
use crate::read::text::{self, quoted};

/// Radius of sticks, ångström.
const STICK_RADIUS: f32 = 0.1;
/// Radius of the ball of an atom, relative to its covalent radius.
const BALL_OF_RADIUS: f32 = 0.5;
/// How much longer a bond may be than the sum of the radii, ångström.
const BOND_TOLERANCE: f32 = 0.45;
/// Atoms closer than this are the same, or an error of the file; ångström.
const MIN_BOND: f32 = 0.4;
/// Most pairs of atoms in neighboring cells for each atom. In matter there are about a hundred.
const MAX_PAIRS_PER_ATOM: usize = 4000;

/// Most bonds by distance for each atom. In the densest crystals, where each atom touches twelve, there are six.
const MAX_BONDS_PER_ATOM: usize = 8;

/// Atoms and the bonds that the file states.
#[derive(Default)]
struct Molecule {
    positions: Vec<[f32; 3]>,
    elements: Vec<Element>,
    bonds: Vec<[u32; 2]>,
    /// Whether bonds of an atom are stated.
    is_bonded: Vec<bool>,
    warnings: Vec<String>,
    n_unknown: usize,
}

impl Molecule {
    /// Adds an atom; `name` is the symbol of its element.
    fn add(&mut self, position: [f32; 3], name: &[u8]) {
        let element = Element::named(name).unwrap_or_else(|| {
            if self.n_unknown == 0 {
                self.warnings.push(format!("unknown element {}: its atoms are drawn as carbon", quoted(name)));
            }
            self.n_unknown += 1;
            Element::named(b"C").expect("carbon is an element")
        });
        self.positions.push(position);
        self.elements.push(element);
        self.is_bonded.push(false);
    }

    /// Balls, then sticks.
    fn into_strands(mut self, path: &Path, options: &ReadOptions) -> Result<Strands, ReadError> {
        let n = point_index(path, self.positions.len())?;
        let mut strands = Strands { segments: (0..n).map(|atom| [atom; 2]).collect(), ..Strands::default() };
        match self.near_bonds() {
            Some(near) => self.bonds.extend(near),
            None => self.warnings.push("atoms are too dense to find bonds by distance".to_owned()),
        }
        let mut radii: Vec<f32> = (self.elements.iter())
            .map(|element| options.point_radius.unwrap_or(BALL_OF_RADIUS * element.covalent_radius))
            .collect();
        let mut colors: Vec<[f32; 3]> = self.elements.iter().map(|element| element.color()).collect();
        strands.points = self.positions;
        let stick = options.line_radius.unwrap_or(STICK_RADIUS);
        for bond in self.bonds {
            let first = point_index(path, strands.points.len() + 2)? - 2;
            for atom in bond.map(|atom| atom as usize) {
                strands.points.push(strands.points[atom]);
                radii.push(stick);
                colors.push(colors[atom]);
            }
            strands.segments.push([first, first + 1]);
        }
        (strands.radii, strands.colors, strands.warnings) = (Some(radii), Some(colors), self.warnings);
        Ok(strands)
    }

    /// Bonds by distance between atoms that are not both in stated bonds, in the order of their atoms; `None` for too many atoms in a place.
    fn near_bonds(&self) -> Option<Vec<[u32; 2]>> {
        let n = self.positions.len();
        let reach = 2.0 * MAX_COVALENT_RADIUS + BOND_TOLERANCE;
        let cell_of = |position: [f32; 3]| position.map(|x| (x / reach).floor() as i64);
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        let is_finite = |&atom: &u32| self.positions[atom as usize].iter().all(|x| x.is_finite());
        for atom in (0..n as u32).filter(is_finite) {
            cells.entry(cell_of(self.positions[atom as usize])).or_default().push(atom);
        }
        let stated: HashSet<[u32; 2]> = self.bonds.iter().copied().collect();
        let mut n_pairs = 0;
        let mut bonds = Vec::new();
        for atom in (0..n as u32).filter(is_finite) {
            let position = self.positions[atom as usize];
            let [x, y, z] = cell_of(position);
            let first = bonds.len();
            for offset in 0..27_i64 {
                let cell = [x + offset % 3 - 1, y + offset / 3 % 3 - 1, z + offset / 9 - 1];
                let Some(others) = cells.get(&cell) else { continue };
                n_pairs += others.len();
                if n_pairs > MAX_PAIRS_PER_ATOM.saturating_mul(n) {
                    return None;
                }
                let is_bond = |&&other: &&u32| {
                    let [i, k] = [atom, other].map(|atom| atom as usize);
                    let far = self.elements[i].covalent_radius + self.elements[k].covalent_radius + BOND_TOLERANCE;
                    let square: f32 = (0..3).map(|axis| (position[axis] - self.positions[k][axis]).powi(2)).sum();
                    other > atom
                        && !(self.is_bonded[i] && self.is_bonded[k])
                        && (MIN_BOND..=far).contains(&square.sqrt())
                        && !stated.contains(&[atom, other])
                };
                bonds.extend(others.iter().filter(is_bond).map(|&other| [atom, other]));
            }
            if bonds.len() > MAX_BONDS_PER_ATOM.saturating_mul(n) {
                return None;
            }
            bonds[first..].sort_unstable();
        }
        Some(bonds)
    }
}

/// The columns `from..=to` of a record, counted from 1 as in the format, without blanks around.
fn columns(line: &[u8], from: usize, to: usize) -> &[u8] {
    line.get(from - 1..line.len().min(to)).unwrap_or_default().trim_ascii()
}

/// Parses a PDB file.
pub(super) fn parse_pdb(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Strands, ReadError> {
    let mut molecule = Molecule::default();
    let mut atoms: HashMap<&[u8], u32> = HashMap::new();
    let mut stated = HashSet::new();
    let (mut n_models, mut n_alternatives, mut n_absent) = (0, 0, 0_usize);
    for (number, line) in lines(bytes) {
        let malformed = |message: String| ReadError::malformed(path, format!("line {number}"), message);
        match columns(line, 1, 6) {
            b"MODEL" => n_models += 1,
            b"ATOM" | b"HETATM" if n_models <= 1 => {
                // Of several places of an atom the first is read.
                if !matches!(columns(line, 17, 17), b"" | b"A" | b"1") {
                    n_alternatives += 1;
                    continue;
                }
                let coordinate = |from: usize| {
                    let word = columns(line, from, from + 7);
                    text::float(word).ok_or_else(|| malformed(format!("{} is not a coordinate", quoted(word))))
                };
                let position = [coordinate(31)?, coordinate(39)?, coordinate(47)?];
                let element = match columns(line, 77, 78) {
                    b"" => element_of_name(line),
                    element => element,
                };
                atoms.insert(columns(line, 7, 11), point_index(path, molecule.positions.len())?);
                molecule.add(position, element);
            }
            b"CONECT" => {
                let atom = |from: usize| atoms.get(columns(line, from, from + 4)).copied();
                let from = atom(7);
                for column in [12, 17, 22, 27].into_iter().filter(|&at| !columns(line, at, at + 4).is_empty()) {
                    let Some((a, b)) = from.zip(atom(column)) else {
                        n_absent += 1;
                        continue;
                    };
                    [a, b].into_iter().for_each(|atom| molecule.is_bonded[atom as usize] = true);
                    let bond = [a.min(b), a.max(b)];
                    if a != b && stated.insert(bond) {
                        molecule.bonds.push(bond);
                    }
                }
            }
            _ => {}
        }
    }
    if molecule.positions.is_empty() {
        return Err(ReadError::empty(path, "no atoms"));
    }
    let mut warn = |n: usize, what: &str| {
        if n > 0 {
            molecule.warnings.push(format!("{what}: {n}"));
        }
    };
    warn(usize::saturating_sub(n_models, 1), "skipping models after the first");
    warn(n_alternatives, "skipping alternative places of atoms");
    warn(n_absent, "skipping bonds of atoms that the file has not");
    molecule.into_strands(path, options)
}

/// The element of an atom by its name in the columns 13 to 16: symbols of one letter begin in column 14, but for names of hydrogen with four
/// characters.
fn element_of_name(line: &[u8]) -> &[u8] {
    let name = line.get(12..line.len().min(16)).unwrap_or_default();
    match name {
        [b'H' | b'h', .., last] if name.len() == 4 && !last.is_ascii_whitespace() => &name[..1],
        [first, second, ..] if first.is_ascii_alphabetic() && second.is_ascii_alphabetic() => {
            if Element::named(&name[..2]).is_some() { &name[..2] } else { &name[..1] }
        }
        [first, ..] if first.is_ascii_alphabetic() => &name[..1],
        [_, second, ..] if second.is_ascii_alphabetic() => &name[1..2],
        _ => name.trim_ascii(),
    }
}

/// The physical lines of a text with their numbers from 1, without their ends.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut rest = text::after_mark(bytes);
    (1..).map_while(move |number| {
        let (line, after) = rest.split_at(text::line_length(rest));
        rest = after;
        (!line.is_empty()).then(|| (number, line.trim_ascii_end()))
    })
}

/// Parses an XYZ file: the number of atoms, a comment, then a line per atom, symbol or atomic number and three coordinates.
pub(super) fn parse_xyz(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Strands, ReadError> {
    let malformed = |number: usize, message: String| ReadError::malformed(path, format!("line {number}"), message);
    let mut all = lines(bytes);
    let first = all.next().map_or(&b""[..], |(_, line)| line.trim_ascii());
    let n_atoms = text::integer(first).and_then(|n| usize::try_from(n).ok());
    let n_atoms = n_atoms.ok_or_else(|| malformed(1, format!("{} is not a number of atoms", quoted(first))))?;
    let mut molecule = Molecule::default();
    let mut rows = all.skip(1);
    while molecule.positions.len() < n_atoms {
        let Some((number, line)) = rows.next() else {
            let message = format!("the file has {} atoms, its first line says {n_atoms}", molecule.positions.len());
            return Err(ReadError::malformed(path, "atoms", message));
        };
        let words: Vec<&[u8]> = text::words(line).take(4).collect();
        let [element, numbers @ ..] = &words[..] else { continue };
        let coordinate = |k: usize| {
            let word = numbers.get(k).ok_or_else(|| malformed(number, "an atom has three coordinates".to_owned()))?;
            text::float(word).ok_or_else(|| malformed(number, format!("{} is not a coordinate", quoted(word))))
        };
        // Some programs number atoms, as in C12.
        let n_letters = element.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
        let symbol = if n_letters == 0 { element } else { &element[..n_letters] };
        molecule.add([coordinate(0)?, coordinate(1)?, coordinate(2)?], symbol);
    }
    if n_atoms == 0 {
        return Err(ReadError::empty(path, "no atoms"));
    }
    if rows.any(|(_, line)| !line.is_empty()) {
        molecule.warnings.push("skipping what follows the first molecule".to_owned());
    }
    molecule.into_strands(path, options)
}
