//! Tests of documents: the book, its pictures, texts, and the order of the house.

mod architecture;
mod book;
mod plots;
mod texts;
