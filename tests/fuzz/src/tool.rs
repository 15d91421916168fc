//! What goes with the targets: names, seeds, dictionaries, single inputs.

use crate::memory::LONGEST;
use crate::targets::{TARGETS, Target, target};
use crate::{seeds, words};
use camino::Utf8Path;

const USAGE: &str = "usage: targets | longest TARGET | seeds TARGET FOLDER | dictionary TARGET | run TARGET FILE.. | bases FOLDER";

/// Does what a line of words says, and gives the exit code: 2 for words that say nothing.
///
/// # Panics
/// When an input breaks its reader.
#[must_use]
pub fn tool(line: &[&str]) -> i32 {
    if let [_, name, ..] = line
        && line[0] != "bases"
        && target(name).is_none()
    {
        let names: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
        eprintln!(
            "there is no target `{name}`; expected one of {}",
            names.join(", ")
        );
        return 2;
    }
    let named = |name: &str| -> &'static Target { target(name).expect("looked up above") };
    match *line {
        ["targets"] => TARGETS.iter().for_each(|t| println!("{}", t.name)),
        ["longest", name] => println!("{}", named(name).longest.min(LONGEST)),
        ["seeds", name, folder] => {
            for bytes in seeds::of(name) {
                let file = blake3::hash(&bytes).to_hex()[..16].to_owned();
                let file = Utf8Path::new(folder).join(file);
                std::fs::write(file, bytes).expect("a folder to write to");
            }
        }
        ["dictionary", name] => print!("{}", words::dictionary(&words::of(name))),
        ["run", name, ref files @ ..] => {
            tell_signals();
            for file in files {
                named(name).run(&std::fs::read(file).unwrap_or_else(|e| panic!("{file}: {e}")));
            }
        }
        ["bases", folder] => seeds::write_bases(Utf8Path::new(folder)),
        _ => {
            eprintln!("{USAGE}");
            return 2;
        }
    }
    0
}

/// Has a signal that ends the process say where it came, so that a crash within libhdf5 has a name: exit code 70 then, and 71 for one
/// of ours.
fn tell_signals() {
    extern "C" fn told(signal: libc::c_int) {
        // The process is lost: what is not allowed in a handler can at worst end it in another way.
        let trace = std::backtrace::Backtrace::force_capture().to_string();
        let place = trace.lines().map(str::trim).find_map(|l| {
            let name = l.split_once(": ")?.1;
            name.starts_with("H5").then(|| name.to_owned())
        });
        match &place {
            Some(name) => eprintln!("signal {signal} within libhdf5: {name}"),
            None => eprintln!("signal {signal}\n{trace}"),
        }
        // SAFETY: ends the process at once.
        unsafe { libc::_exit(if place.is_some() { 70 } else { 71 }) };
    }
    for signal in [
        libc::SIGSEGV,
        libc::SIGBUS,
        libc::SIGFPE,
        libc::SIGILL,
        libc::SIGABRT,
    ] {
        // SAFETY: the handler is a function of this signature.
        unsafe {
            libc::signal(
                signal,
                told as extern "C" fn(libc::c_int) as libc::sighandler_t,
            )
        };
    }
}
