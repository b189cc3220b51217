//! Computation of jobs in processes of their own: the program that they run, and the memory that each may use.

use super::config::WorkConfig;
use super::unit::Unit;
use std::fs;
use std::path::{Path, PathBuf};

/// Way in which each job is computed in a process of its own.
#[derive(Clone, Debug)]
pub(crate) struct Isolation {
    /// Program that is started as the process of a job: this program.
    pub(super) program: PathBuf,
    /// Number of threads on which the process of one job computes.
    pub(super) threads: usize,
    /// Upper bound in bytes on the memory of each process; `None` if the memory of the machine is not known.
    pub(super) memory: Option<u64>,
}

/// Part of the machine's memory that jobs share by default: 3/4. Raising it leaves less for the process that started
/// them and for other programs.
const PART: (u64, u64) = (3, 4);

impl Isolation {
    /// Reads from a configuration how jobs are isolated; `None` if this process computes them itself. `threads` is the
    /// number of threads for one job.
    pub(super) fn of(config: &WorkConfig, threads: usize) -> Option<Self> {
        let program = config.isolate.clone()?;
        let stated = Some(config.limits.job_memory).filter(|bytes| *bytes > 0);
        let memory = stated.or_else(|| share(memory(Path::new("/"))?, config.workers));
        Some(Self { program, threads, memory })
    }

    /// Returns the upper bound on the memory of one job, in words for the user.
    pub(super) fn limit(&self) -> String {
        self.memory.map_or_else(|| "the machine's memory".to_owned(), |bytes| Unit::Bytes.show(bytes))
    }
}

/// Returns the memory in bytes for each of `workers` jobs on a machine with `memory` bytes, in whole MiB.
fn share(memory: u64, workers: usize) -> Option<u64> {
    let part = memory / PART.1 * PART.0 / (workers.max(1) as u64);
    Some(part >> 20 << 20).filter(|part| *part > 0)
}

/// Returns the memory in bytes that the processes of this service may use together: that of the machine, or less if a
/// control group limits it. `root` is the root directory, which contains `proc` and `sys`.
fn memory(root: &Path) -> Option<u64> {
    let machine = fs::read_to_string(root.join("proc/meminfo")).ok()?;
    let machine = machine.lines().find_map(|line| line.strip_prefix("MemTotal:")?.trim().strip_suffix("kB"))?;
    let machine = machine.trim().parse::<u64>().ok()?.checked_mul(1024)?;
    let groups = fs::read_to_string(root.join("proc/self/cgroup")).unwrap_or_default();
    let limits = groups.lines().filter_map(|line| {
        // `0::/path` in version 2, `4:memory:/path` in version 1.
        let (_, rest) = line.split_once(':')?;
        let (controllers, path) = rest.split_once(':')?;
        let (tree, file) = match controllers {
            "" => (root.join("sys/fs/cgroup"), "memory.max"),
            list if list.split(',').any(|name| name == "memory") => {
                (root.join("sys/fs/cgroup/memory"), "memory.limit_in_bytes")
            }
            _ => return None,
        };
        // Each group above limits this one, too.
        let group = tree.join(path.trim_start_matches('/'));
        let read = |group: &Path| fs::read_to_string(group.join(file)).ok()?.trim().parse::<u64>().ok();
        group.ancestors().take_while(|group| group.starts_with(&tree)).filter_map(read).min()
    });
    limits.chain([machine]).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_that_of_the_machine_or_of_the_smallest_control_group_above() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        assert_eq!(memory(root.path()), None);
        write("proc/meminfo", "MemTotal:       16384 kB\nMemFree:        1 kB\n");
        assert_eq!(memory(root.path()), Some(16 << 20));
        write("proc/self/cgroup", "0::/system.slice/wavelume.service\n");
        write("sys/fs/cgroup/system.slice/wavelume.service/memory.max", "max\n");
        assert_eq!(memory(root.path()), Some(16 << 20));
        write("sys/fs/cgroup/system.slice/memory.max", "8388608\n");
        assert_eq!(memory(root.path()), Some(8 << 20));
        write("proc/self/cgroup", "5:cpu:/x\n4:memory:/docker/a\n");
        write("sys/fs/cgroup/memory/docker/a/memory.limit_in_bytes", "4194304\n");
        assert_eq!(memory(root.path()), Some(4 << 20));
    }

    #[test]
    fn jobs_share_three_quarters_of_the_memory_unless_a_limit_is_set() {
        assert_eq!((share(16 << 30, 1), share(16 << 30, 4), share(1, 1)), (Some(12 << 30), Some(3 << 30), None));
        let mut config = WorkConfig::new("");
        assert!(Isolation::of(&config, 1).is_none());
        config.isolate = Some("/bin/wavelume".into());
        config.limits.job_memory = 5 << 30;
        let isolation = Isolation::of(&config, 2).unwrap();
        assert_eq!((isolation.memory, isolation.threads, isolation.limit()), (Some(5 << 30), 2, "5GiB".to_owned()));
    }
}
