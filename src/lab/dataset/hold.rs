//! Locks of the runs that are at work in the folder of a data set: each has a file there for its shard, as long as it lives.

use std::path::Path;

use super::DatasetError;
use crate::issue::FileError;
use crate::output::lock::Hold;

/// Name of the file of a shard's run.
fn name([index, count]: [u32; 2]) -> String {
    format!(".shard-{index}-of-{count}.lock")
}

/// The shard of the file of a run; none for other names.
pub(super) fn shard(name: &str) -> Option<[u32; 2]> {
    let (index, count) = name.strip_prefix(".shard-")?.strip_suffix(".lock")?.split_once("-of-")?;
    let [index, count] = [index.parse().ok()?, count.parse().ok()?];
    (index < count).then_some([index, count])
}

/// True if two shards have one of `parts` parts in common: shard i of n has those whose number leaves i when divided by n.
fn share([index, count]: [u32; 2], [other, others]: [u32; 2], parts: usize) -> bool {
    let own = (index as usize..parts).step_by(count as usize);
    own.into_iter().any(|part| part % others as usize == other as usize)
}

/// Takes the shard's parts, of so many in all, for this run; shards that have none of them are made beside it. What killed
/// runs have left is removed.
///
/// # Errors
/// Another run makes one of them; the folder cannot be written.
pub(super) fn take(root: &Path, shard: [u32; 2], parts: usize) -> Result<Hold, DatasetError> {
    let busy = |[index, count]: [u32; 2]| {
        let message =
            format!("another run makes samples of this shard here: shard {index}/{count}");
        let remedy = "wait for its end or stop it, and add --resume (Python: resume=True); or name a new folder; runs side by \
                      side need shards of one number: 0/2 and 1/2";
        DatasetError::File(FileError::file(root, message, remedy))
    };
    std::fs::create_dir_all(root).map_err(|e| DatasetError::writing(root, e))?;
    let taken = |shard: [u32; 2]| {
        let path = root.join(name(shard));
        Hold::take(&path).map_err(|e| DatasetError::writing(&path, e))
    };
    let own = taken(shard)?.ok_or_else(|| busy(shard))?;
    let all = std::fs::read_dir(root).map_err(|e| DatasetError::reading(root, e))?;
    let names = all.flatten().map(|entry| entry.file_name());
    let others = names.filter_map(|name| self::shard(&name.to_string_lossy()));
    for other in others.filter(|other| *other != shard && share(shard, *other, parts)) {
        // One that could be taken is a dead one's, and goes.
        taken(other)?.ok_or_else(|| busy(other))?;
    }
    Ok(own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_with_a_part_in_common_are_not_made_side_by_side() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("set");
        let taken = |shard| take(&root, shard, 10);
        let first = taken([1, 4]).unwrap();
        // Parts 1, 5 and 9 are its own; of the others 0, 4 and 8, 3 and 7, and 6.
        let others = [[0, 4], [3, 4], [6, 10]].map(|shard| taken(shard).unwrap());
        for shard in [[1, 4], [0, 1], [1, 2], [2, 3], [5, 10]] {
            let Err(DatasetError::File(error)) = taken(shard) else { panic!("{shard:?}") };
            assert_eq!(error.file, root);
            assert!(error.message.contains("another run makes"), "{}", error.message);
            assert!(error.remedy.contains("--resume"), "{}", error.remedy);
            // The one that is in its way is named.
            let named = error.message.ends_with("shard 1/4");
            assert!(named || ![[1, 4], [5, 10]].contains(&shard), "{}", error.message);
        }
        drop(first);
        drop(taken([5, 10]).expect("its part is free now"));
        drop(others);
        // As killed runs leave them.
        for shard in [[0, 1], [3, 7]] {
            std::fs::write(root.join(name(shard)), "").unwrap();
        }
        drop(taken([0, 1]).expect("nobody is at work"));
        assert_eq!(std::fs::read_dir(&root).unwrap().count(), 0, "nothing is left");
    }

    #[test]
    fn names_of_runs_are_told_from_others() {
        assert_eq!(shard(&name([7, 10])), Some([7, 10]));
        for name in ["manifest.json", ".shard-7-of-7.lock", ".shard-x-of-7.lock", ".lock"] {
            assert_eq!(shard(name), None, "{name}");
        }
    }
}
