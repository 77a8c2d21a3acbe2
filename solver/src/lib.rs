#![doc = include_str!("../README.md")]

pub mod adaptive;
pub mod contact;
pub mod event;
pub mod events;
pub mod expansion;
pub mod fesd;
pub mod hybrid;
pub mod integrate;
pub mod linalg;
pub mod moreau;
pub mod optimization;
pub mod runtime;
pub mod selector;
pub mod sensitivity;
pub mod tape;
