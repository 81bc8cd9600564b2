//! Teaching, forgetting, and what a cut leaves.
