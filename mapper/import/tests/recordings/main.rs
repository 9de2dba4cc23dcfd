//! What is written into recordings comes out of them. The files were written by programs of others: see the scripts in
//! `data/`.

mod bags;
mod damage;
mod folders;
mod place;
