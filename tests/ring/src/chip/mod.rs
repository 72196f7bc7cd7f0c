//! The SERCON816 at register and RAM level.
