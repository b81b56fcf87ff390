//! Files that are complete or not there, written under another name and then renamed; and standard output.

use anyhow::Context;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// Writes a file so that nobody ever sees half of it.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(format!(".{}.part", std::process::id()));
    let unfinished = Path::new(&unfinished);
    let written = fs::File::create(unfinished)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(unfinished, path));
    if written.is_err() {
        // The failure to write is what the user must hear of, whether or not the rest can be removed.
        let _ = fs::remove_file(unfinished);
    }
    written.with_context(|| format!("cannot write {}", path.display()))
}

/// Prints to standard output; a reader that has seen enough, as in `capsense solve … | head -1`, is no failure.
pub(super) fn print_out(text: &str) -> anyhow::Result<()> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}
