//! Tactus on a PC.
