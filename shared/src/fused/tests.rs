//! Features and whitening against f64.
