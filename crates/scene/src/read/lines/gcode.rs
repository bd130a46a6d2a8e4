//! Paths of an extruder from G-code, as Marlin documents it: moves `G0` to `G3` during which the extruder pushes.
//!
//! Modes: `G90` and `G91` (absolute or relative coordinates), `M82` and `M83` (of the extruder), `G92` (new coordinates of where the tool is),
//! `G20` and `G21` (inches, millimeters), `G28` (home is the origin). The extruder is relative after `M83`, and after `G91`, until
//! `M82` and `G90`. Arcs in the plane of x and y, by the offset of their center or by their radius, become chords of at most ten degrees. Other commands do not
//! move.

use std::path::Path;

use super::{Strands, point_index};
use crate::read::error::ReadError;
use crate::read::input::ReadOptions;
use crate::read::text::{self, quoted};

/// Radius of a path where none is given, millimeters: half the diameter of the usual nozzle.
const DEFAULT_RADIUS: f32 = 0.2;
const MILLIMETERS_PER_INCH: f64 = 25.4;
/// Most degrees of an arc in one segment.
const ARC_STEP_DEGREES: f64 = 10.0;

/// Where the tool is, millimeters, and how coordinates are read.
struct Machine {
    /// x, y, z and the extruder.
    at: [f64; 4],
    /// Machine coordinates of the origin that `G92` sets.
    origin: [f64; 4],
    is_relative: bool,
    extruder_is_relative: bool,
    unit: f64,
}

/// Words of a line by letter; the last of several.
#[derive(Default)]
struct Words {
    values: [Option<f64>; 26],
    /// The letter of the command: the first one that is not that of a line number.
    command: u8,
}

impl Words {
    /// # Errors
    /// The word that is not a letter with a number.
    fn of(mut text: &[u8]) -> Result<Self, &[u8]> {
        let mut words = Self::default();
        loop {
            text = text.trim_ascii_start();
            let [letter, rest @ ..] = text else { return Ok(words) };
            let rest = rest.trim_ascii_start();
            let is_number = |byte: &u8| byte.is_ascii_digit() || b"+-.".contains(byte);
            let length = rest.iter().position(|byte| !is_number(byte)).unwrap_or(rest.len());
            let number = &rest[..length];
            let value = std::str::from_utf8(number).ok().and_then(|number| number.parse().ok());
            let is_name = letter.is_ascii_alphabetic();
            // An axis without a number, as in `G28 X`, is at 0.
            let value = value.or((number.is_empty() && is_name).then_some(0.0));
            let Some(value) = value.filter(|_| is_name) else { return Err(text) };
            let letter = letter.to_ascii_uppercase();
            words.values[usize::from(letter - b'A')] = Some(value);
            if words.command == 0 && letter != b'N' {
                words.command = letter;
            }
            text = &rest[length..];
        }
    }

    fn get(&self, letter: u8) -> Option<f64> {
        self.values[usize::from(letter - b'A')]
    }

    /// x, y, z and the extruder.
    fn axes(&self) -> [Option<f64>; 4] {
        [b'X', b'Y', b'Z', b'E'].map(|letter| self.get(letter))
    }
}

/// A line without comments, line number and checksum.
fn command(line: &[u8]) -> Vec<u8> {
    let line = line.split(|&byte| byte == b';' || byte == b'*').next().unwrap_or_default();
    let mut depth = 0_u32;
    let mut kept = Vec::with_capacity(line.len());
    for &byte in line {
        match byte {
            b'(' => depth += 1,
            b')' => depth = depth.saturating_sub(1),
            _ if depth == 0 => kept.push(byte),
            _ => {}
        }
    }
    kept
}

impl Machine {
    /// The target of a move.
    fn target(&self, axes: [Option<f64>; 4]) -> [f64; 4] {
        std::array::from_fn(|k| {
            let is_relative = self.is_relative || k == 3 && self.extruder_is_relative;
            match axes[k].map(|value| value * self.unit) {
                None => self.at[k],
                Some(value) if is_relative => self.at[k] + value,
                Some(value) => self.origin[k] + value,
            }
        })
    }

    /// Points of a move after its start.
    fn points(&self, words: &Words, target: [f64; 4], turn: Option<f64>) -> Vec<[f64; 3]> {
        let [x, y, z, _] = self.at;
        let end = [target[0], target[1], target[2]];
        let center = match [words.get(b'I'), words.get(b'J')] {
            [None, None] => (turn.zip(words.get(b'R')))
                .and_then(|(sign, radius)| center_by_radius([end[0] - x, end[1] - y], radius * self.unit, sign)),
            offsets => Some(offsets.map(|offset| offset.unwrap_or(0.0) * self.unit)),
        };
        let (Some(sign), Some([i, j])) = (turn, center) else { return vec![end] };
        let (from, to) = ((-j).atan2(-i), (end[1] - y - j).atan2(end[0] - x - i));
        let mut sweep = sign * (to - from);
        // Equal ends make a full circle.
        if sweep <= 1e-9 {
            sweep += std::f64::consts::TAU;
        }
        let n = (sweep.to_degrees() / ARC_STEP_DEGREES).ceil().max(1.0) as u32;
        let radius = i.hypot(j);
        let inner = (1..n).map(|k| {
            let part = f64::from(k) / f64::from(n);
            let angle = from + sign * sweep * part;
            [x + i + radius * angle.cos(), y + j + radius * angle.sin(), z + (end[2] - z) * part]
        });
        inner.chain([end]).collect()
    }
}

/// The center of an arc relative to its start, by its radius and the vector to its end; `turn` is 1 for counter-clockwise, -1 for clockwise. A negative radius is
/// that of the longer arc. `None` for an end that is the start.
fn center_by_radius([dx, dy]: [f64; 2], radius: f64, turn: f64) -> Option<[f64; 2]> {
    let half = 0.5 * dx.hypot(dy);
    let side = if radius < 0.0 { -turn } else { turn };
    // A radius that is too small for the ends is half of their distance.
    let height = ((radius.abs() - half) * (radius.abs() + half)).max(0.0).sqrt();
    let part = 0.5 * side * height / half;
    (half > 0.0).then_some([0.5 * dx - part * dy, 0.5 * dy + part * dx])
}

/// Parses the moves.
pub(super) fn parse(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Strands, ReadError> {
    let mut machine =
        Machine { at: [0.0; 4], origin: [0.0; 4], is_relative: false, extruder_is_relative: false, unit: 1.0 };
    let mut strands = Strands::default();
    let mut n_wrong = 0_usize;
    let mut rest = text::after_mark(bytes);
    let mut number = 0;
    while !rest.is_empty() {
        let (line, after) = rest.split_at(text::line_length(rest));
        (rest, number) = (after, number + 1);
        let line = command(line.trim_ascii());
        let is_wanted = |byte: &u8| b"GMNgmn".contains(byte);
        if !line.trim_ascii_start().first().is_some_and(is_wanted) {
            continue;
        }
        let words = match Words::of(&line) {
            Ok(words) => words,
            // Text after a command of another kind, as in `M117 Hello`.
            Err(_) if !line.trim_ascii_start().starts_with(b"G") => continue,
            Err(word) => {
                if n_wrong == 0 {
                    let warning =
                        format!("skipping commands that are not numbers, as {} in line {number}", quoted(word));
                    strands.warnings.push(warning);
                }
                n_wrong += 1;
                continue;
            }
        };
        let code = |letter: u8| {
            let code = words.get(letter).filter(|code| words.command == letter && (0.0..1e4).contains(code));
            code.map(|code| code as u32)
        };
        match (code(b'G'), code(b'M')) {
            (Some(code @ 0..=3), _) => {
                let target = machine.target(words.axes());
                if !target.iter().all(|x| x.is_finite()) {
                    let message = format!("the target {target:?} is not finite");
                    return Err(ReadError::malformed(path, format!("line {number}"), message));
                }
                let moves = target[..3] != machine.at[..3] || code >= 2;
                if moves && target[3] > machine.at[3] {
                    let turn = [None, None, Some(-1.0), Some(1.0)][code as usize];
                    extrude(path, &mut strands, machine.at, &machine.points(&words, target, turn))?;
                }
                machine.at = target;
            }
            (Some(20), _) => machine.unit = MILLIMETERS_PER_INCH,
            (Some(21), _) => machine.unit = 1.0,
            (Some(28), _) => {
                let axes = [b'X', b'Y', b'Z'].map(|axis| words.get(axis).is_some());
                let all = !axes.contains(&true);
                for k in (0..3).filter(|&k| all || axes[k]) {
                    (machine.at[k], machine.origin[k]) = (0.0, 0.0);
                }
            }
            (Some(90), _) => machine.is_relative = false,
            (Some(91), _) => machine.is_relative = true,
            (Some(92), _) => {
                let axes = words.axes();
                let all = axes.iter().all(Option::is_none);
                for (k, value) in axes.into_iter().enumerate() {
                    if let Some(value) = value.or(all.then_some(0.0)) {
                        machine.origin[k] = machine.at[k] - value * machine.unit;
                    }
                }
            }
            (None, Some(82)) => machine.extruder_is_relative = false,
            (None, Some(83)) => machine.extruder_is_relative = true,
            _ => {}
        }
    }
    if n_wrong > 1 {
        strands.warnings.push(format!("commands that are not numbers: {n_wrong}"));
    }
    if strands.segments.is_empty() {
        return Err(ReadError::empty(path, "no moves that extrude"));
    }
    strands.radii = Some(vec![options.line_radius.unwrap_or(DEFAULT_RADIUS); strands.points.len()]);
    Ok(strands)
}

/// Adds the segments of a move; a move that goes on where the last one ended shares its point.
fn extrude(path: &Path, strands: &mut Strands, from: [f64; 4], points: &[[f64; 3]]) -> Result<(), ReadError> {
    let from = [from[0], from[1], from[2]].map(|x| x as f32);
    if strands.points.last() != Some(&from) {
        strands.points.push(from);
    }
    for point in points {
        let last = point_index(path, strands.points.len())? - 1;
        strands.points.push(point.map(|x| x as f32));
        strands.segments.push([last, last + 1]);
    }
    Ok(())
}
