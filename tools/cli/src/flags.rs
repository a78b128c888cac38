//! Flags that several commands share.

pub(crate) mod backend;
pub(crate) mod colours;
pub(crate) mod depth;
pub(crate) mod encoder;
pub(crate) mod frame;
pub(crate) mod method;
pub(crate) mod outputs;
