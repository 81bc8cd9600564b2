//! What the STM32F4 does in its own way.
pub(super) mod bank2;
pub(super) mod spi;
