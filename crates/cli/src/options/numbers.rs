//! How numbers on the command line are read: what they are not is told with the word that was given.

/// `N` finite numbers separated by commas.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != N {
        return Err(format!("{N} numbers separated by commas are needed, not {}", parts.len()));
    }
    let mut numbers = [0.0; N];
    for (number, part) in numbers.iter_mut().zip(parts) {
        *number = match part.trim().parse::<f32>() {
            Ok(x) if x.is_finite() => x,
            _ => return Err(format!("'{part}' is not a finite number")),
        };
    }
    Ok(numbers)
}

/// A finite number.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    text.trim().parse::<f32>().ok().filter(|x| x.is_finite()).ok_or_else(|| format!("'{text}' is not a finite number"))
}

/// A finite number that is not negative.
pub(crate) fn factor(text: &str) -> Result<f32, String> {
    number(text).ok().filter(|&x| x >= 0.0).ok_or_else(|| format!("'{text}' is not a finite number from 0 on"))
}

/// Three finite numbers separated by commas.
pub(crate) fn triple(text: &str) -> Result<[f32; 3], String> {
    numbers::<3>(text)
}

/// Six finite numbers separated by commas.
pub(crate) fn sextuple(text: &str) -> Result<[f32; 6], String> {
    numbers::<6>(text)
}

/// Pixels that one picture may have: more would not fit in the memory of ordinary machines.
const MAX_PIXELS: u64 = 1 << 26;

/// Width and height as `WxH`.
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("a size is WIDTHxHEIGHT, as 1280x720")?;
    let side = |text: &str| match text.trim().parse::<u32>() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("'{text}' is not a number of pixels")),
    };
    let size = [side(width)?, side(height)?];
    if u64::from(size[0]) * u64::from(size[1]) > MAX_PIXELS {
        return Err(format!("{} x {} pixels are more than {MAX_PIXELS}", size[0], size[1]));
    }
    Ok(size)
}

/// Degrees between 0 and 180, ends excluded.
pub(crate) fn fov(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(degrees) if degrees > 0.0 && degrees < 180.0 => Ok(degrees),
        _ => Err(format!("'{text}' is not an angle between 0 and 180 degrees")),
    }
}

/// A finite length, zero included.
pub(crate) fn lens_radius(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(radius) if radius >= 0.0 && radius.is_finite() => Ok(radius),
        _ => Err(format!("'{text}' is not a length of zero or more")),
    }
}

/// A length above zero; infinity is one.
pub(crate) fn radius(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(radius) if radius > 0.0 => Ok(radius),
        _ => Err(format!("'{text}' is not a length above zero")),
    }
}

/// A number of threads from 1 to 1024.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if (1..=1024).contains(&n) => Ok(n),
        _ => Err(format!("'{text}' is not a number of threads from 1 to 1024")),
    }
}
