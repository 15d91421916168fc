//! Crashes in its initialisers, before anyone can ask it anything.

extern "C" fn crash() {
    std::process::abort();
}

#[used]
#[unsafe(link_section = ".init_array")]
static CRASH: extern "C" fn() = crash;
