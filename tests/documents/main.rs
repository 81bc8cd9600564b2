//! Tests of documents: the book, its pictures, texts, and the order of the house.

#[path = "../architecture/main.rs"]
mod architecture;
mod book;
mod plots;
mod texts;
