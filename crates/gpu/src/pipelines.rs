//! Compiled pipelines that a program keeps in a folder from one run to the next, because drivers compile for seconds.
//!
//! A driver checks that what it made is for its device and its version. A checksum finds files that were cut short or changed since.

use std::{
    fs,
    hash::{DefaultHasher, Hasher},
    io::Write,
    path::{Path, PathBuf},
};

use wgpu::{Device, Features, PipelineCache};

use crate::trusted;

/// How a file starts; the checksum of the rest follows.
const MAGIC: [u8; 8] = *b"CANTEDP1";

/// Most bytes that are read. Pipelines of a scene take some hundred kilobytes.
const MOST: u64 = 1 << 28;

/// What a driver compiled, and its file.
pub(crate) struct KeptPipelines {
    pub(crate) cache: PipelineCache,
    path: PathBuf,
    /// Checksum of what the file has; `None` without a file.
    kept: Option<u64>,
}

impl KeptPipelines {
    /// Those in a file of `folder` for this model of device; `None` if the driver cannot give its pipelines away.
    pub(crate) fn open(device: &Device, folder: &Path) -> Option<Self> {
        if !device.features().contains(Features::PIPELINE_CACHE) {
            return None;
        }
        let path = folder.join(wgpu::util::pipeline_cache_key(&device.adapter_info())?);
        let (data, kept) = read(&path).unzip();
        Some(Self { cache: trusted::pipeline_cache(device, data.as_deref()), path, kept })
    }

    /// Writes the file, if the driver compiled something since.
    fn write(&self) -> std::io::Result<()> {
        let Some(data) = self.cache.get_data() else { return Ok(()) };
        let sum = checksum(&data);
        if self.kept == Some(sum) {
            return Ok(());
        }
        if let Some(folder) = self.path.parent() {
            fs::create_dir_all(folder)?;
        }
        // Another run may read the file meanwhile, or write one of its own.
        let part = self.path.with_extension(format!("{}.part", std::process::id()));
        let written = fs::File::create(&part).and_then(|mut file| {
            file.write_all(&MAGIC)?;
            file.write_all(&sum.to_le_bytes())?;
            file.write_all(&data)
        });
        let moved = written.and_then(|()| fs::rename(&part, &self.path));
        if moved.is_err() {
            let _ = fs::remove_file(&part);
        }
        moved
    }
}

impl Drop for KeptPipelines {
    fn drop(&mut self) {
        // Without the file the next run compiles again.
        let _ = self.write();
    }
}

fn checksum(data: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(data);
    hasher.finish()
}

/// What a file of [`KeptPipelines::write`] has, with its checksum; `None` for any other file.
fn read(path: &Path) -> Option<(Vec<u8>, u64)> {
    if fs::metadata(path).ok()?.len() > MOST {
        return None;
    }
    let bytes = fs::read(path).ok()?;
    let (sum, data) = bytes.strip_prefix(&MAGIC)?.split_first_chunk::<8>()?;
    let sum = u64::from_le_bytes(*sum);
    (checksum(data) == sum).then(|| (data.to_vec(), sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file is read as it was written, and ignored with any byte changed or missing.
    #[test]
    fn damaged_files_are_ignored() {
        let folder = std::env::temp_dir().join(format!("canted-pipelines-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("file");
        let data = b"pipelines of a driver";
        let mut bytes = MAGIC.to_vec();
        bytes.extend(checksum(data).to_le_bytes());
        bytes.extend(data);
        fs::write(&path, &bytes).unwrap();
        assert_eq!(read(&path), Some((data.to_vec(), checksum(data))));
        for i in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[i] ^= 4;
            fs::write(&path, &changed).unwrap();
            assert_eq!(read(&path), None, "byte {i}");
            fs::write(&path, &bytes[..i]).unwrap();
            assert_eq!(read(&path), None, "{i} bytes");
        }
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(read(&path), None);
    }
}
