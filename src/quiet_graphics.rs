//! Keeps what is not ours off standard error. Programs that open no window take this file as a module of their own, as the
//! environment may be changed only before there are threads.

/// Without a session's runtime folder, Mesa's device selection complains on standard error about a display that nobody opens;
/// a user would take that for a failure of ours. To be called first of all.
pub(crate) fn keep_the_graphics_stack_quiet() {
    let unset = |name| std::env::var_os(name).is_none();
    if unset("XDG_RUNTIME_DIR") && unset("NODEVICE_SELECT") {
        // SAFETY: the first thing the program does; no other thread exists that could read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
