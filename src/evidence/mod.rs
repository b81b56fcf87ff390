//! Evidence about the methods: experiments that anyone can run again.

pub mod stress;
