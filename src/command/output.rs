//! Files that are complete or not there: written under another name, then renamed.

use anyhow::Context;
use std::fs;
use std::io::Write;
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
