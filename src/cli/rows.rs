//! Files of numbered rows that many programs may work on: Monte Carlo studies
//! and sweeps.
//!
//! A file has a line of JSON a row, and `FILE.study.json` beside it says what
//! the study is. One program at a time adds to a file; shards have files of
//! their own. What is there is not done again.

use std::collections::BTreeMap;
use std::fs::TryLockError;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use clap::Args;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::{CliError, Outcome, output};
use coaxdesign::pipeline::differences;
use coaxdesign::report::progress::Progress;

/// A row of a study.
pub trait Row: Serialize + DeserializeOwned + Send {
    /// Its number, from 0.
    fn index(&self) -> usize;
}

/// Which part of a study, and where its rows go.
#[derive(Debug, Args)]
pub struct RowArgs {
    /// Do only this part of the study, such as 0/4 to 3/4
    #[arg(long, value_name = "I/N")]
    shard: Option<String>,
    /// File of rows, JSON lines
    #[arg(short, long, value_name = "FILE.jsonl")]
    output: Option<PathBuf>,
    /// Add the rows of these files (of the same study) to the summary, and to -o
    #[arg(long, value_name = "FILE.jsonl", num_args = 1..)]
    merge: Vec<PathBuf>,
    /// End with exit code 1 if a row is no success
    #[arg(long)]
    fail_on_miss: bool,
    /// End a merge with exit code 1 if rows of the study are missing
    #[arg(long, value_name = "BOOL", default_value_t = true, action = clap::ArgAction::Set)]
    require_complete: bool,
}

/// A study whose rows are asked for.
pub struct Job<'a, H> {
    /// What it is: all that changes a row.
    pub head: &'a H,
    /// Its name: a hash of the head.
    pub hash: String,
    /// Names of the rows' columns, and their units.
    pub columns: Vec<(String, String)>,
    /// Number of rows of the whole study.
    pub count: usize,
    /// What the rows are, for people, such as `runs`.
    pub noun: &'static str,
    /// What is being done, for the progress bar.
    pub doing: &'static str,
}

impl RowArgs {
    /// Rows that are there, and those that are asked for and made here, by
    /// their numbers. `only` asks for one of them alone.
    ///
    /// # Errors
    /// A file of another study or that another program adds to, and the first
    /// error of `make`.
    pub fn rows<H: Serialize + Sync, R: Row>(
        &self,
        job: &Job<'_, H>,
        only: Option<usize>,
        quiet: bool,
        make: impl Fn(usize) -> Result<R, CliError> + Sync,
    ) -> Result<BTreeMap<usize, R>, CliError> {
        let mut known = BTreeMap::new();
        let file = self.output.as_deref().map(|path| RowFile::open(path, job, &mut known));
        let file = file.transpose()?;
        for path in &self.merge {
            read_rows(path, job, &mut known)?;
        }
        let wanted = self.wanted(job.count, job.noun, only)?;
        let missing: Vec<usize> = wanted.into_iter().filter(|k| !known.contains_key(k)).collect();
        let file = Mutex::new(file);
        let progress = Progress::new(job.doing, missing.len() as u64, quiet);
        let made: Vec<R> = missing
            .par_iter()
            .map(|&index| {
                let row = make(index)?;
                if let Some(file) = file.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
                    file.add(&row)?;
                }
                progress.advance();
                Ok(row)
            })
            .collect::<Result<_, CliError>>()?;
        progress.finish();
        known.extend(made.into_iter().map(|row| (row.index(), row)));
        if let Some(file) = file.into_inner().unwrap_or_else(PoisonError::into_inner) {
            file.finish(&known)?;
        }
        Ok(known)
    }

    /// Rows that this command is to make, if they are not there yet.
    fn wanted(
        &self,
        count: usize,
        noun: &str,
        only: Option<usize>,
    ) -> Result<Vec<usize>, CliError> {
        let wanted: Vec<usize> = match (&self.shard, only) {
            (_, Some(only)) => vec![only],
            (Some(shard), None) => {
                let (index, shards) = shard_of(shard)?;
                (0..count).filter(|k| k % shards == index).collect()
            }
            // Merging alone makes nothing.
            (None, None) if !self.merge.is_empty() => Vec::new(),
            (None, None) => (0..count).collect(),
        };
        match wanted.iter().find(|k| **k >= count) {
            Some(beyond) => Err(CliError::Usage {
                message: format!("there is no run {beyond}"),
                help: format!("the study's {noun} are 0 to {}", count - 1),
            }),
            None => Ok(wanted),
        }
    }

    /// What is made is done; a merge that lacks rows, and a miss where that was
    /// asked about, is not.
    pub fn outcome(&self, count: usize, noun: &str, there: usize, missed: bool) -> Outcome {
        if !self.merge.is_empty() && self.require_complete && there < count {
            output::note(&format!(
                "error: {} of {count} {noun} are missing\n  help: make the shards that are not \
                 there; --require-complete false takes what is\n",
                count - there
            ));
            return Outcome::GoalMissed;
        }
        if self.fail_on_miss && missed { Outcome::GoalMissed } else { Outcome::Done }
    }
}

/// `I/N`.
fn shard_of(text: &str) -> Result<(usize, usize), CliError> {
    let parts = text.split_once('/').and_then(|(index, count)| {
        Some((index.trim().parse::<usize>().ok()?, count.trim().parse::<usize>().ok()?))
    });
    match parts {
        Some((index, count)) if index < count => Ok((index, count)),
        _ => Err(CliError::Usage {
            message: format!("--shard {text:?}: not a part of a whole"),
            help: "write --shard 0/4 to --shard 3/4".into(),
        }),
    }
}

/// The file beside a file of rows that says what their study is:
/// `runs.study.json` for `runs.jsonl`.
fn head_path(path: &Path) -> PathBuf {
    path.with_extension("study.json")
}

/// What the head file holds: the study's hash, the head, and the rows' units.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct HeadFile {
    study: String,
    head: Json,
    /// Units of the columns.
    units: BTreeMap<String, String>,
}

fn internal(error: &serde_json::Error) -> CliError {
    CliError::Internal(error.to_string())
}

/// A file of rows that this program alone adds to.
struct RowFile {
    path: PathBuf,
    /// Locked for as long as it is open.
    file: std::fs::File,
}

impl RowFile {
    /// Opens a file and locks it; what it holds of the study goes to `known`.
    /// A last line without an end was interrupted, and is cut off.
    ///
    /// # Errors
    /// Another program that adds to it, or a file of another study.
    fn open<H: Serialize, R: Row>(
        path: &Path,
        job: &Job<'_, H>,
        known: &mut BTreeMap<usize, R>,
    ) -> Result<Self, CliError> {
        let io = |source| CliError::Io { path: path.into(), source };
        let mut options = std::fs::OpenOptions::new();
        let file = options.read(true).append(true).create(true).open(path).map_err(io)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(CliError::Usage {
                    message: format!("{}: another program is adding to it", path.display()),
                    help: "give each shard a file of its own, and join them with --merge".into(),
                });
            }
            Err(TryLockError::Error(source)) => return Err(io(source)),
        }
        if file.metadata().map_err(io)?.len() == 0 {
            let beside = HeadFile {
                study: job.hash.clone(),
                head: serde_json::to_value(job.head).map_err(|error| internal(&error))?,
                units: job.columns.iter().cloned().collect(),
            };
            let text = serde_json::to_string_pretty(&beside).map_err(|error| internal(&error))?;
            output::write_whole(&head_path(path), (text + "\n").as_bytes(), true)?;
        } else {
            let whole = read_rows(path, job, known)?;
            file.set_len(whole).map_err(io)?;
        }
        Ok(Self { path: path.into(), file })
    }

    fn add<R: Row>(&mut self, row: &R) -> Result<(), CliError> {
        let line = serde_json::to_string(row).map_err(|error| internal(&error))?;
        self.file
            .write_all((line + "\n").as_bytes())
            .map_err(|source| CliError::Io { path: self.path.clone(), source })
    }

    /// Puts the rows in order, so that the bytes do not depend on the threads.
    fn finish<R: Row>(self, rows: &BTreeMap<usize, R>) -> Result<(), CliError> {
        let mut text = String::new();
        for row in rows.values() {
            text += &serde_json::to_string(row).map_err(|error| internal(&error))?;
            text.push('\n');
        }
        output::write_whole(&self.path, text.as_bytes(), true)
    }
}

/// Adds the rows of a file, and gives the length of its whole lines: a last
/// line without an end is one that was interrupted.
fn read_rows<H: Serialize, R: Row>(
    path: &Path,
    job: &Job<'_, H>,
    known: &mut BTreeMap<usize, R>,
) -> Result<u64, CliError> {
    let read = |path: &Path| {
        std::fs::read_to_string(path).map_err(|source| CliError::Io { path: path.into(), source })
    };
    let other = |path: &Path, message: String| CliError::Usage {
        message: format!("{}: {message}", path.display()),
        help: "give another file with -o, or the arguments that the file was made with".into(),
    };
    let text = read(path)?;
    let beside = head_path(path);
    if !beside.exists() {
        let name = beside.display();
        return Err(other(path, format!("there is no {name}, which says what its study is")));
    }
    let found: HeadFile = serde_json::from_str(&read(&beside)?)
        .map_err(|error| other(&beside, format!("it describes no study: {error}")))?;
    let differences = differences(&found.head, job.head);
    if !differences.is_empty() {
        let list = differences.join("\n  ");
        return Err(other(path, format!("it holds another study:\n  {list}")));
    }
    let mut length = 0;
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    for (number, line) in whole.enumerate() {
        let row: R = serde_json::from_str(line)
            .map_err(|error| other(path, format!("line {}: {error}", number + 1)))?;
        known.insert(row.index(), row);
        length += line.len() as u64;
    }
    Ok(length)
}

/// Rows as comma-separated values, under the names of their columns.
///
/// # Errors
/// None in practice: rows can be written as JSON.
pub fn to_csv<R: Row>(names: &[String], rows: &BTreeMap<usize, R>) -> Result<String, CliError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let broken = |error: &dyn std::fmt::Display| CliError::Internal(error.to_string());
    writer.write_record(names).map_err(|error| broken(&error))?;
    for row in rows.values() {
        let row = serde_json::to_value(row).map_err(|error| broken(&error))?;
        let cells = row.as_object().into_iter().flat_map(|row| row.values());
        let cells = cells.map(|value| match value {
            Json::Null => String::new(),
            Json::String(text) => text.clone(),
            other => other.to_string(),
        });
        writer.write_record(cells).map_err(|error| broken(&error))?;
    }
    let bytes = writer.into_inner().map_err(|error| broken(&error))?;
    String::from_utf8(bytes).map_err(|error| broken(&error))
}
