//! Writing results, whole or not at all.

use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::CliError;

/// Writes a file in one piece: the bytes go to a temporary file in the same
/// directory, which then takes the name. A reader sees the old file or the
/// new one, never half of one. A link is followed, and a device or a pipe is
/// simply written to.
///
/// Without `overwrite`, a file that is already there is left alone.
///
/// # Errors
/// [`CliError::Exists`] and [`CliError::Io`].
pub fn write_whole(path: &Path, bytes: &[u8], overwrite: bool) -> Result<(), CliError> {
    let mut file = WholeFile::create(path, overwrite)?;
    file.write(bytes)?;
    file.finish()
}

/// A file that is written bit by bit, but is there whole or not at all; see
/// [`write_whole`].
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    target: PathBuf,
    overwrite: bool,
    sink: Sink,
}

/// Where the bytes go on the way.
#[derive(Debug)]
enum Sink {
    /// A file that will take the name.
    Temporary(BufWriter<tempfile::NamedTempFile>),
    /// A device or a pipe: taking its name would destroy it.
    Device(BufWriter<std::fs::File>),
}

impl WholeFile {
    /// Begins a file.
    ///
    /// # Errors
    /// [`CliError::Exists`] and [`CliError::Io`].
    pub fn create(path: &Path, overwrite: bool) -> Result<Self, CliError> {
        let fault = |source| CliError::Io { path: path.into(), source };
        let mut target = path.to_path_buf();
        if let Ok(there) = std::fs::metadata(path) {
            if there.is_dir() {
                return Err(fault(ErrorKind::IsADirectory.into()));
            }
            if !there.is_file() {
                let device = std::fs::OpenOptions::new().write(true).open(path).map_err(fault)?;
                let sink = Sink::Device(BufWriter::new(device));
                return Ok(Self { path: path.into(), target, overwrite, sink });
            }
            if !overwrite {
                return Err(CliError::Exists { path: path.into() });
            }
            target = path.canonicalize().map_err(fault)?;
            if INPUTS.lock().is_ok_and(|inputs| inputs.contains(&target)) {
                return Err(CliError::Usage {
                    message: format!("{}: this command reads the file", path.display()),
                    help: "write the result to another file".into(),
                });
            }
        }
        let directory = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        clean(directory);
        builder.prefix(TEMPORARY);
        // An ordinary new file, less what the process masks: a temporary one
        // would be closed to everybody else.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(directory).map_err(fault)?;
        // Until it is closed, nobody takes it for one that was left behind. A
        // file system without locks has only its age.
        let _ = file.as_file().try_lock();
        let sink = Sink::Temporary(BufWriter::new(file));
        Ok(Self { path: path.into(), target, overwrite, sink })
    }

    /// Adds bytes.
    ///
    /// # Errors
    /// [`CliError::Io`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), CliError> {
        match &mut self.sink {
            Sink::Temporary(file) => file.write_all(bytes),
            Sink::Device(file) => file.write_all(bytes),
        }
        .map_err(|source| CliError::Io { path: self.path.clone(), source })
    }

    /// Lets the file take its name.
    ///
    /// # Errors
    /// [`CliError::Exists`] and [`CliError::Io`].
    pub fn finish(self) -> Result<(), CliError> {
        let Self { path, target, overwrite, sink } = self;
        let fault = |source| CliError::Io { path: path.clone(), source };
        let file = match sink {
            Sink::Device(mut file) => return file.flush().map_err(fault),
            Sink::Temporary(file) => file.into_inner().map_err(|e| fault(e.into_error()))?,
        };
        file.as_file().sync_all().map_err(fault)?;
        let persisted = if overwrite {
            file.persist(&target)
        } else {
            // Refuses a file that came to be since the look above.
            file.persist_noclobber(&target)
        };
        match persisted {
            Ok(_) => {
                tracing::info!(path = %path.display(), "written");
                Ok(())
            }
            Err(error) if error.error.kind() == ErrorKind::AlreadyExists => {
                Err(CliError::Exists { path })
            }
            Err(error) => Err(fault(error.error)),
        }
    }
}

impl std::io::Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match &mut self.sink {
            Sink::Temporary(file) => file.write(bytes),
            Sink::Device(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match &mut self.sink {
            Sink::Temporary(file) => file.flush(),
            Sink::Device(file) => file.flush(),
        }
    }
}

/// Whether two paths lead to one file, which need not be there yet.
pub fn same_file(a: &Path, b: &Path) -> bool {
    let whole = |path: &Path| {
        if let Ok(found) = path.canonicalize() {
            return Some(found);
        }
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(parent.canonicalize().ok()?.join(path.file_name()?))
    };
    a == b || matches!((whole(a), whole(b)), (Some(a), Some(b)) if a == b)
}

/// Files that this command has read.
static INPUTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Notes that a file is an input of this command, which no result may replace.
pub fn is_input(path: &Path) {
    if let Ok(whole) = path.canonicalize()
        && let Ok(mut inputs) = INPUTS.lock()
    {
        inputs.push(whole);
    }
}

/// Words as a shell takes them: quoted where they hold more than letters,
/// digits and harmless marks.
pub fn shell_line(words: &[String]) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./:,=+@%".contains(c);
    let quoted = |word: &String| {
        if !word.is_empty() && word.chars().all(plain) {
            word.clone()
        } else if word.contains(['"', '$', '`', '\\', '!']) {
            format!("'{}'", word.replace('\'', "'\\''"))
        } else {
            format!("\"{word}\"")
        }
    };
    words.iter().map(quoted).collect::<Vec<_>>().join(" ")
}

/// Prefix of temporary files.
const TEMPORARY: &str = ".coaxdesign-";
/// Temporary files younger than this may belong to a command that has not
/// locked them yet, s.
const YOUNG: u64 = 10;

/// Removes temporary files that a killed command left in a directory. Those of
/// a command at work are locked. What cannot be removed is left.
pub fn clean(directory: &Path) {
    let Ok(entries) = std::fs::read_dir(directory) else { return };
    for entry in entries.flatten() {
        let ours = entry.file_name().to_str().is_some_and(|name| name.starts_with(TEMPORARY));
        let old = entry
            .metadata()
            .and_then(|m| m.modified())
            .is_ok_and(|t| t.elapsed().is_ok_and(|age| age.as_secs() >= YOUNG));
        if !ours || !old {
            continue;
        }
        let path = entry.path();
        if path.is_dir() {
            let guard = std::fs::File::open(path.join(GUARD));
            // Files that were there before and were not put back are kept.
            let kept = std::fs::read_dir(path.join("old")).is_ok_and(|mut d| d.next().is_some());
            if !kept && guard.is_ok_and(|file| file.try_lock().is_ok()) {
                let _ = std::fs::remove_dir_all(&path);
            }
        } else if std::fs::File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// The file of a temporary directory that is locked while it is in use.
const GUARD: &str = "guard";

/// Writes several files into a directory, which is made if it is not there:
/// all of them or none. Every file is first written whole under another name;
/// then all take their names, and if one cannot, those before it give theirs
/// back to what was there.
///
/// # Errors
/// [`CliError::Exists`] and [`CliError::Io`].
pub fn write_set(
    directory: &Path,
    files: &[(String, Vec<u8>)],
    overwrite: bool,
) -> Result<(), CliError> {
    let fault = |path: &Path| {
        let path = path.to_path_buf();
        move |source| CliError::Io { path, source }
    };
    let targets: Vec<PathBuf> = files.iter().map(|f| directory.join(&f.0)).collect();
    for target in &targets {
        if target.is_dir() {
            return Err(fault(target)(ErrorKind::IsADirectory.into()));
        }
        if target.symlink_metadata().is_ok() && !overwrite {
            return Err(CliError::Exists { path: target.clone() });
        }
    }
    std::fs::create_dir_all(directory).map_err(fault(directory))?;
    clean(directory);
    // On the same file system as the targets, so that a rename suffices.
    let stage = tempfile::Builder::new()
        .prefix(TEMPORARY)
        .tempdir_in(directory)
        .map_err(fault(directory))?;
    let guard = std::fs::File::create(stage.path().join(GUARD)).map_err(fault(directory))?;
    let _ = guard.try_lock();
    let (new, old) = (stage.path().join("new"), stage.path().join("old"));
    for part in [&new, &old] {
        std::fs::create_dir(part).map_err(fault(directory))?;
    }
    for (name, bytes) in files {
        let path = new.join(name);
        // Names may lead into folders.
        let parents = [&new, &old].map(|part| part.join(name));
        for parent in parents.iter().chain([&directory.join(name)]).filter_map(|p| p.parent()) {
            std::fs::create_dir_all(parent).map_err(fault(parent))?;
        }
        let mut file = std::fs::File::create(&path).map_err(fault(&directory.join(name)))?;
        file.write_all(bytes).map_err(fault(&directory.join(name)))?;
        file.sync_all().map_err(fault(&directory.join(name)))?;
    }
    for (k, ((name, _), target)) in files.iter().zip(&targets).enumerate() {
        let placed = (|| {
            if target.symlink_metadata().is_ok() {
                std::fs::rename(target, old.join(name))?;
            }
            std::fs::rename(new.join(name), target)
        })();
        if let Err(source) = placed {
            for ((name, _), target) in files.iter().zip(&targets).take(k + 1) {
                let kept = old.join(name);
                // The first failure is the one to report.
                let _ = if kept.symlink_metadata().is_ok() {
                    std::fs::rename(kept, target)
                } else {
                    std::fs::remove_file(target)
                };
            }
            return Err(fault(target)(source));
        }
    }
    Ok(())
}

/// Writes a text to standard output. A reader that has had enough and closed
/// the pipe is no error.
///
/// # Errors
/// [`CliError::Io`].
pub fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(CliError::Io { path: "standard output".into(), source })
        }
        _ => Ok(()),
    }
}

/// Writes a text to standard error. There is nobody to tell if that fails.
pub fn note(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// A number with so many significant digits, without trailing zeros:
/// `10.66`, `0.0021`, `1.2e-7`.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    let scientific = format!("{value:.*e}", digits.max(1) - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return scientific;
    };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trim = |text: &str| -> String {
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').into()
        } else {
            text.into()
        }
    };
    if !(-5..=digits as i32 + 2).contains(&exponent) {
        return format!("{}e{exponent}", trim(mantissa));
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    trim(&format!("{value:.decimals$}"))
}

/// Lines of cells as aligned columns: the first is set left, the others
/// right; two spaces between. Lines may differ in length.
pub fn aligned(lines: &[Vec<String>]) -> String {
    let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        lines
            .iter()
            .filter_map(|line| line.get(column))
            .map(|cell| cell.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for line in lines {
        let mut whole = String::new();
        for (index, (cell, width)) in line.iter().zip(&widths).enumerate() {
            if index == 0 {
                whole += &format!("{cell:<width$}");
            } else {
                whole += &format!("  {cell:>width$}");
            }
        }
        text += whole.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_written_whole_and_not_replaced_unasked() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("result.txt");
        write_whole(&path, b"first", false).unwrap();
        assert!(matches!(write_whole(&path, b"second", false), Err(CliError::Exists { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        write_whole(&path, b"second", true).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        // Nothing else is left behind.
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
        assert!(matches!(write_whole(directory.path(), b"x", true), Err(CliError::Io { .. })));
        assert!(matches!(
            write_whole(&directory.path().join("none/x"), b"x", true),
            Err(CliError::Io { .. })
        ));
    }

    #[test]
    fn a_set_is_written_whole_or_not_at_all() {
        let directory = tempfile::tempdir().unwrap();
        let place = directory.path().join("sub");
        let set = |text: &str| {
            ["a", "b"].map(|n| (n.to_string(), format!("{n} {text}").into_bytes())).to_vec()
        };
        let read = |n: &str| std::fs::read_to_string(place.join(n)).unwrap();
        write_set(&place, &set("first"), false).unwrap();
        assert_eq!((read("a"), read("b")), ("a first".into(), "b first".into()));
        // One that is there stops both.
        std::fs::remove_file(place.join("a")).unwrap();
        assert!(matches!(write_set(&place, &set("x"), false), Err(CliError::Exists { .. })));
        assert!(!place.join("a").exists());
        // So does one that cannot be written.
        let mut bad = set("x");
        bad[1].0 = "b/c".into();
        assert!(matches!(write_set(&place, &bad, true), Err(CliError::Io { .. })));
        assert!(!place.join("a").exists());
        assert_eq!(read("b"), "b first");
        write_set(&place, &set("second"), true).unwrap();
        assert_eq!((read("a"), read("b")), ("a second".into(), "b second".into()));
        assert_eq!(std::fs::read_dir(&place).unwrap().count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_are_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let directory = tempfile::tempdir().unwrap();
        let (file, link) = (directory.path().join("file"), directory.path().join("link"));
        std::fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_whole(&link, b"new", true).unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert!(link.symlink_metadata().unwrap().is_symlink());
        let null = Path::new("/dev/null");
        write_whole(null, b"x", true).unwrap();
        assert!(std::fs::metadata(null).unwrap().file_type().is_char_device());
    }

    #[test]
    fn numbers_keep_their_significant_digits() {
        for (value, text) in [
            (10.66, "10.66"),
            (0.0, "0"),
            (-0.002_123_456, "-0.0021235"),
            (123_456.7, "123457"),
            (1.0, "1"),
            (100.0, "100"),
            (1.234e-9, "1.234e-9"),
            (9.999_999, "10"),
            (2.5e12, "2.5e12"),
        ] {
            assert_eq!(significant(value, 5), text);
        }
    }

    #[test]
    fn columns_align() {
        let line = |cells: &[&str]| cells.iter().map(ToString::to_string).collect();
        let text = aligned(&[line(&["β", "1"]), line(&["radius", "10.66", "ft"]), line(&[])]);
        assert_eq!(text, "β           1\nradius  10.66  ft\n\n");
    }
}
