//! Tests of documents: the book, its pictures, and the order of the house.

#[path = "../architecture/main.rs"]
mod architecture;
mod book;
mod plots;
