//! The lumped turbocharger model of Burke et al., and the laws it is made of.

pub mod params;
