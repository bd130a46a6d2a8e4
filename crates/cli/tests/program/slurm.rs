//! The scripts of `examples/slurm`, run by a single-machine Slurm that the test starts and stops.
//!
//! Skipped without Slurm or MUNGE. Not covered: accounts, partitions, several machines.

use std::{
    env,
    ffi::OsString,
    fs::{self, File},
    net::TcpListener,
    os::unix::fs::PermissionsExt,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use canted_fixtures::skip;

use crate::support::Folder;

const PROGRAMS: [&str; 4] = ["munged", "slurmctld", "slurmd", "sbatch"];

/// A process that is killed on drop.
struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        // Errors mean that it has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The folder of the program, then those of the system and its daemons.
fn search_path() -> OsString {
    let own = Path::new(env!("CARGO_BIN_EXE_canted")).parent().unwrap().to_owned();
    let known = env::var_os("PATH").unwrap_or_default();
    env::join_paths([own].into_iter().chain(env::split_paths(&known)).chain(["/usr/sbin".into()])).unwrap()
}

fn is_installed(program: &str) -> bool {
    env::split_paths(&search_path()).any(|folder| folder.join(program).is_file())
}

/// An unused port.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A single-machine Slurm whose files are all in `folder`.
struct Slurm<'a> {
    folder: &'a Folder,
    /// Stopped in this order.
    _daemons: Vec<Daemon>,
}

impl<'a> Slurm<'a> {
    fn start(folder: &'a Folder) -> Self {
        let host = text(&Command::new("hostname").arg("-s").output().unwrap());
        let user = text(&Command::new("id").arg("-un").output().unwrap());
        let root = folder.path("slurm");
        for name in ["state", "spool", "run"] {
            fs::create_dir_all(root.join(name)).unwrap();
        }
        fs::set_permissions(root.join("run"), fs::Permissions::from_mode(0o755)).unwrap();
        let root = root.display().to_string();
        let [port, node_port] = [free_port(), free_port()];
        folder.write(
            "slurm/slurm.conf",
            format!(
                "ClusterName=canted\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser={user}\nSlurmdUser={user}\n\
                 AuthType=auth/munge\nAuthInfo=socket={root}/run/munge.socket\n\
                 SlurmctldPort={port}\nSlurmdPort={node_port}\n\
                 StateSaveLocation={root}/state\nSlurmdSpoolDir={root}/spool\n\
                 SlurmctldPidFile={root}/run/slurmctld.pid\nSlurmdPidFile={root}/run/slurmd.pid\n\
                 ProctrackType=proctrack/pgid\nTaskPlugin=task/none\nMpiDefault=none\nReturnToService=2\n\
                 SelectType=select/cons_tres\nSelectTypeParameters=CR_Core\nSlurmdParameters=config_overrides\n\
                 NodeName={host} NodeAddr=127.0.0.1 CPUs=2\n\
                 PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP\n"
            ),
        );
        folder.write("slurm/munge.key", [7; 1024]);
        fs::set_permissions(folder.path("slurm/munge.key"), fs::Permissions::from_mode(0o400)).unwrap();
        let keys = format!(
            "--force --foreground --key-file {root}/munge.key --socket {root}/run/munge.socket --pid-file \
             {root}/run/munged.pid --log-file {root}/munged.log --seed-file {root}/run/munge.seed"
        );
        let munged = daemon(folder, "munged", &keys);
        wait_until("munged listens", || folder.path("slurm/run/munge.socket").exists());
        let controller = daemon(folder, "slurmctld", "-D -i");
        let node = daemon(folder, "slurmd", &format!("-D -N {host}"));
        let slurm = Self { folder, _daemons: vec![node, controller, munged] };
        wait_until("the machine is idle", || slurm.run("sinfo --noheader --format=%T").contains("idle"));
        slurm
    }

    /// The standard output of a command in the folder.
    fn run(&self, line: &str) -> String {
        text(&command(self.folder, line).output().unwrap())
    }
}

/// A command that uses this Slurm.
fn command(folder: &Folder, line: &str) -> Command {
    let mut words = line.split_whitespace();
    let mut command = Command::new(words.next().unwrap());
    command.args(words).current_dir(folder.path("")).stdin(Stdio::null());
    command.env("SLURM_CONF", folder.path("slurm/slurm.conf")).env("PATH", search_path());
    command
}

fn daemon(folder: &Folder, program: &str, options: &str) -> Daemon {
    let log = File::create(folder.path(&format!("slurm/{program}.out"))).unwrap();
    let mut command = command(folder, &format!("{program} {options}"));
    Daemon(command.stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap())
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

fn wait_until(what: &str, mut is_true: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_true() {
        assert!(start.elapsed() < Duration::from_secs(120), "waited two minutes until {what}");
        sleep(Duration::from_millis(200));
    }
}

#[test]
fn an_array_job_and_a_merge_give_the_picture_of_one_machine() {
    if let Some(missing) = PROGRAMS.into_iter().find(|program| !is_installed(program)) {
        let reason = format_args!("{missing} of Debian's slurm-wlm and munge is not installed");
        skip::<()>("an_array_job_and_a_merge_give_the_picture_of_one_machine", reason);
        return;
    }
    let folder = Folder::with_small();
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/slurm");
    let render = "small.obj --size 40x30 --aovs all";
    folder.run(&format!("render {render} --samples 0..32 -o one.exr")).done();

    let slurm = Slurm::start(&folder);
    let submit = scripts.join("submit.sh").display().to_string();
    let merge = slurm.run(&format!("{submit} 3 32 parts whole.exr {render}"));
    let state = || slurm.run(&format!("scontrol show job {merge} --oneliner"));
    wait_until("the merge has ended", || {
        ["COMPLETED", "FAILED", "CANCELLED"].iter().any(|end| state().contains(&format!("JobState={end}")))
    });
    assert!(state().contains("JobState=COMPLETED"), "{}", state());
    assert!(folder.bytes("whole.exr") == folder.bytes("one.exr"));
    let parts: Vec<_> = (0..3).map(|task| format!("parts/{task}.exr")).collect();
    assert!(parts.iter().all(|name| folder.path(name).exists()));
}
