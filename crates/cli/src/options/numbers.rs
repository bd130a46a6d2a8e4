//! Parsers of numbers on the command line.

/// `N` finite numbers separated by commas.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != N {
        return Err(format!("expected {N} numbers separated by commas, found {}", parts.len()));
    }
    let mut numbers = [0.0; N];
    for (number, part) in numbers.iter_mut().zip(parts) {
        *number = self::number(part)?;
    }
    Ok(numbers)
}

/// A finite number.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    number_where(text, f32::is_finite).ok_or_else(|| format!("'{text}' is not a finite number"))
}

/// A finite number that is not negative.
pub(crate) fn factor(text: &str) -> Result<f32, String> {
    number_where(text, |x| x >= 0.0 && x.is_finite())
        .ok_or_else(|| format!("'{text}' is not a finite number of at least 0"))
}

/// An angle in degrees, in the open interval (0, 180).
pub(crate) fn fov(text: &str) -> Result<f32, String> {
    number_where(text, |x| x > 0.0 && x < 180.0)
        .ok_or_else(|| format!("'{text}' is not an angle between 0 and 180 degrees"))
}

/// A positive length, possibly infinite.
pub(crate) fn radius(text: &str) -> Result<f32, String> {
    number_where(text, |x| x > 0.0).ok_or_else(|| format!("'{text}' is not a length greater than zero"))
}

/// A positive finite number.
pub(crate) fn noise(text: &str) -> Result<f32, String> {
    number_where(text, |x| x > 0.0 && x.is_finite())
        .ok_or_else(|| format!("'{text}' is not a finite number greater than zero"))
}

fn number_where(text: &str, is_valid: impl Fn(f32) -> bool) -> Option<f32> {
    text.trim().parse().ok().filter(|&x| is_valid(x))
}

/// The largest picture in pixels. More would not fit in the memory of ordinary machines.
const MAX_PIXELS: u64 = 1 << 26;

/// Width and height as `WxH`.
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT, e.g. 1280x720")?;
    let side = |text: &str| match text.trim().parse::<u32>() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("'{text}' is not a positive number of pixels")),
    };
    let size = [side(width)?, side(height)?];
    if u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS {
        return Err(format!("{} x {} pixels exceed the limit of {MAX_PIXELS}", size[0], size[1]));
    }
    Ok(size)
}

/// A number of threads from 1 to 1024.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    let n = text.parse().ok().filter(|n| (1..=1024).contains(n));
    n.ok_or_else(|| format!("'{text}' is not a number of threads from 1 to 1024"))
}
