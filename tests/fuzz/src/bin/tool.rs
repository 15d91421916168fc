//! `fuzz-tool targets | longest TARGET | seeds TARGET FOLDER | dictionary TARGET | run TARGET FILE.. | bases FOLDER`: see [`plyflow_fuzz::tool`].

use plyflow_fuzz::memory::Counted;

#[global_allocator]
static MEMORY: Counted = Counted;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    std::process::exit(plyflow_fuzz::tool(&words));
}
