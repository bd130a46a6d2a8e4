//! A looping picture of the frames of a sequence, for documents: an animated PNG, which is lossless.

use std::{fs::File, io::BufReader, io::BufWriter, path::Path};

use anyhow::{Context, Result, ensure};

/// Joins 8-bit RGB frames of equal size into an animated PNG of `fps` frames per second that repeats without end.
///
/// # Errors
/// No frames, a frame that is no such picture, or one of another size.
pub(crate) fn run(out: &Path, fps: &str, frames: &[&str]) -> Result<bool> {
    let fps: u16 = fps.parse().ok().filter(|&fps| fps > 0).with_context(|| format!("{fps} is no number of frames"))?;
    let frames = frames.iter().map(|frame| read(frame.as_ref())).collect::<Result<Vec<_>>>()?;
    let &(size, _) = frames.first().context("no frames")?;
    let file = File::create(out).with_context(|| format!("cannot write {}", out.display()))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), size[0], size[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder.set_animated(u32::try_from(frames.len())?, 0)?;
    encoder.set_frame_delay(1, fps)?;
    let mut writer = encoder.write_header()?;
    for (i, (of_frame, pixels)) in frames.iter().enumerate() {
        ensure!(*of_frame == size, "frame {i} is {of_frame:?} pixels, the first {size:?}");
        writer.write_image_data(pixels)?;
    }
    writer.finish()?;
    Ok(true)
}

/// Size and pixels of an 8-bit RGB file, decoded to its end.
pub(crate) fn read(path: &Path) -> Result<([u32; 2], Vec<u8>)> {
    let name = path.display();
    let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
    let mut reader =
        png::Decoder::new(BufReader::new(file)).read_info().with_context(|| format!("cannot read {name}"))?;
    let mut pixels = vec![0; reader.output_buffer_size().with_context(|| format!("{name} is too large"))?];
    let info = reader.next_frame(&mut pixels).with_context(|| format!("cannot read {name}"))?;
    let is_rgb = (info.color_type, info.bit_depth) == (png::ColorType::Rgb, png::BitDepth::Eight);
    ensure!(is_rgb, "{name} is not 8-bit RGB");
    Ok(([info.width, info.height], pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: &Path, width: u32, value: u8) {
        let mut encoder = png::Encoder::new(File::create(path).unwrap(), width, 2);
        encoder.set_color(png::ColorType::Rgb);
        let pixels = vec![value; width as usize * 6];
        encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    }

    #[test]
    fn frames_are_joined_in_order_and_others_rejected() {
        let folder = crate::command::root().join("target/looping");
        std::fs::create_dir_all(&folder).unwrap();
        let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        let (a, b, wide, out) = (path("a.png"), path("b.png"), path("wide.png"), path("out.png"));
        write(a.as_ref(), 3, 10);
        write(b.as_ref(), 3, 200);
        write(wide.as_ref(), 4, 0);
        run(out.as_ref(), "12", &[&a, &b]).unwrap();
        let mut reader = png::Decoder::new(BufReader::new(File::open(&out).unwrap())).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 2);
        for value in [10, 200] {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, [value; 18]);
        }
        assert!(run(out.as_ref(), "12", &[&a, &wide]).is_err());
        assert!(run(out.as_ref(), "12", &[]).is_err());
        assert!(run(out.as_ref(), "0", &[&a]).is_err());
    }
}
