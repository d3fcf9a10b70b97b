//! One writer a directory.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The file that is locked.
const FILE: &str = ".coaxdesign.lock";

/// Why a directory is not ours to write.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another program writes into it.
    #[error("{}: another command is writing into this directory: {holder}", directory.display())]
    Held {
        /// The directory.
        directory: PathBuf,
        /// Who: process, command, since when.
        holder: String,
    },
    /// The lock cannot be made.
    #[error("{}: {source}", path.display())]
    Io {
        /// The lock's file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Keeps other writers out of a directory until it is dropped. The system
/// releases it when the process ends, however it ends.
#[derive(Debug)]
pub struct DirectoryLock {
    path: PathBuf,
    file: File,
}

impl DirectoryLock {
    /// Locks a directory that exists. `command` is what others are told.
    ///
    /// # Errors
    /// [`LockError::Held`] at once where another has it, naming that one.
    pub fn acquire(directory: &Path, command: &str) -> Result<Self, LockError> {
        let path = directory.join(FILE);
        let fault = |source| LockError::Io { path: path.clone(), source };
        loop {
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(fault)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let mut holder = String::new();
                    // Where a locked file cannot be read, its holder stays unnamed.
                    let _ = file.read_to_string(&mut holder);
                    let holder = holder.trim();
                    let holder = if holder.is_empty() { "an unnamed one" } else { holder };
                    return Err(LockError::Held {
                        directory: directory.into(),
                        holder: holder.into(),
                    });
                }
                Err(TryLockError::Error(source)) => return Err(fault(source)),
            }
            // The one before may have removed the name between open and lock.
            if !is_file_of(&file, &path) {
                continue;
            }
            let line = format!("process {}, `{command}`, since {}\n", std::process::id(), now());
            file.set_len(0)
                .and_then(|()| file.seek(SeekFrom::Start(0)))
                .and_then(|_| file.write_all(line.as_bytes()))
                .map_err(fault)?;
            return Ok(Self { path, file });
        }
    }
}

impl Drop for DirectoryLock {
    fn drop(&mut self) {
        // First the name, then the lock: who opens the name anew finds another
        // file. What cannot be removed is harmless.
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

#[cfg(unix)]
fn is_file_of(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(a), Ok(b)) => a.dev() == b.dev() && a.ino() == b.ino(),
        _ => false,
    }
}

/// Elsewhere an open file cannot be removed.
#[cfg(not(unix))]
fn is_file_of(_file: &File, _path: &Path) -> bool {
    true
}

/// The time of day for people, UTC.
fn now() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    utc(seconds)
}

/// Seconds since 1970 as a date and a time, by the proleptic Gregorian
/// calendar: years are counted from March, so that leap days come last.
fn utc(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!(
        "{:04}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC",
        era * 400 + year + carry,
        rest / 3600,
        rest / 60 % 60,
        rest % 60
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_writer_is_refused_and_told_of_the_first() {
        let home = tempfile::tempdir().unwrap();
        let first = DirectoryLock::acquire(home.path(), "coaxdesign design x.toml").unwrap();
        let error = DirectoryLock::acquire(home.path(), "other").unwrap_err().to_string();
        assert!(error.contains("coaxdesign design x.toml"), "{error}");
        assert!(error.contains(&format!("process {}", std::process::id())), "{error}");
        drop(first);
        assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
        drop(DirectoryLock::acquire(home.path(), "other").unwrap());
        // A file that a crash left is no lock.
        std::fs::write(home.path().join(FILE), "process 1, `dead`, since ever").unwrap();
        DirectoryLock::acquire(home.path(), "next").unwrap();
    }

    #[test]
    fn val_dates_of_the_calendar() {
        assert_eq!(utc(0), "1970-01-01 00:00:00 UTC");
        assert_eq!(utc(951_782_400), "2000-02-29 00:00:00 UTC");
        assert_eq!(utc(1_709_251_199), "2024-02-29 23:59:59 UTC");
        assert_eq!(utc(1_735_689_599), "2024-12-31 23:59:59 UTC");
    }
}
