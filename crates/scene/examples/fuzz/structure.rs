//! Mutations that keep the syntax valid: of JSON values, of TOML lines.

use serde_json::Value;

use crate::mutate::{Random, UNUSUAL_NUMBERS};

/// JSON with one to four mutations; `None` for invalid JSON.
pub(crate) fn json(bytes: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let mut root: Value = serde_json::from_slice(bytes).ok()?;
    for _ in 0..=random.below(4) {
        change(&mut root, random);
    }
    serde_json::to_vec(&root).ok()
}

/// Mutates a random value, each with equal probability.
fn change(root: &mut Value, random: &mut Random) {
    let mut at = random.below(count(root));
    if let Some(value) = nth(root, &mut at) {
        change_value(value, random);
    }
}

/// Number of values including nested ones.
fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(members) => members.values().map(count).sum(),
        _ => 0,
    }
}

/// The value with index `at` in depth-first order.
fn nth<'a>(value: &'a mut Value, at: &mut usize) -> Option<&'a mut Value> {
    if *at == 0 {
        return Some(value);
    }
    *at -= 1;
    match value {
        Value::Array(items) => items.iter_mut().find_map(|item| nth(item, at)),
        Value::Object(members) => members.values_mut().find_map(|member| nth(member, at)),
        _ => None,
    }
}

fn change_value(value: &mut Value, random: &mut Random) {
    match value {
        Value::Number(number) => {
            // Small steps give off-by-one errors.
            let near = number.as_i64().map(|n| n.saturating_add([-1, 1, 2][random.below(3)]).into());
            let unusual = serde_json::from_str(UNUSUAL_NUMBERS[random.below(UNUSUAL_NUMBERS.len())]).ok();
            let new = if random.below(2) == 0 { near } else { unusual };
            *value = new.unwrap_or(Value::from(random.below(6)));
        }
        Value::Array(items) if !items.is_empty() => {
            let [a, b] = [0; 2].map(|_| random.below(items.len()));
            match random.below(4) {
                0 => drop(items.remove(a)),
                1 => items.insert(b, items[a].clone()),
                2 => items.swap(a, b),
                _ => items.truncate(a),
            }
        }
        Value::Object(members) if !members.is_empty() => {
            let keys: Vec<String> = members.keys().cloned().collect();
            let [a, b] = [0; 2].map(|_| &keys[random.below(keys.len())]);
            match (random.below(2), members.get(a).cloned()) {
                (0, Some(other)) => drop(members.insert(b.clone(), other)),
                _ => drop(members.remove(a)),
            }
        }
        Value::Bool(flag) => *flag = !*flag,
        Value::String(text) => {
            let other = ["", "VEC3", "VEC4", "SCALAR", "MASK", "BLEND", "STEP", "CUBICSPLINE", "weights", "scale"];
            *text = other[random.below(other.len())].to_owned();
        }
        Value::Null | Value::Array(_) | Value::Object(_) => *value = Value::from(random.below(6)),
    }
}

/// A scene file with one to four mutations of lines and tables.
pub(crate) fn toml(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes).into_owned();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=random.below(4) {
        change_line(&mut lines, random);
    }
    lines.join("\n").into_bytes()
}

fn change_line(lines: &mut Vec<String>, random: &mut Random) {
    if lines.is_empty() {
        return;
    }
    let [a, b] = [0; 2].map(|_| random.below(lines.len()));
    let value_of = |line: &String| Some(line.split_once('=')?.1.split('#').next()?.trim().to_owned());
    match random.below(5) {
        0 => drop(lines.remove(a)),
        1 => {
            let table = table_of(lines, a);
            let copy = lines[table.clone()].to_vec();
            lines.splice(table.end..table.end, copy);
        }
        2 => drop(lines.drain(table_of(lines, a))),
        // Replaces the value by that of another key, or by an unusual number.
        kind => {
            let number = UNUSUAL_NUMBERS[random.below(UNUSUAL_NUMBERS.len())].to_owned();
            let new = if kind == 3 { value_of(&lines[b]) } else { Some(number) };
            if let (Some((key, _)), Some(new)) = (lines[a].clone().split_once('='), new) {
                lines[a] = format!("{key}= {new}");
            }
        }
    }
}

/// The lines of the table around a line, including its header.
fn table_of(lines: &[String], at: usize) -> std::ops::Range<usize> {
    let is_heading = |line: &String| line.starts_with('[');
    let start = lines[..=at].iter().rposition(is_heading).unwrap_or(0);
    let end = lines[at + 1..].iter().position(is_heading).map_or(lines.len(), |n| at + 1 + n);
    start..end
}
