//! Tests of documents: the book, its pictures, and the order of the house.

mod architecture;
mod book;
mod plots;
