//! Gives the shared library its name for the linker: programs ask for the version whose calls they were built with.
//! Before 1.0 a new minor version may change calls. The library exports its own calls alone, not those that its
//! dependencies export for other languages.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") {
        let name = concat!(
            "libphasefront_c.so.",
            env!("CARGO_PKG_VERSION_MAJOR"),
            ".",
            env!("CARGO_PKG_VERSION_MINOR")
        );
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,{name}");
        println!("cargo:rustc-cdylib-link-arg=-Wl,--exclude-libs,ALL");
    }
}
