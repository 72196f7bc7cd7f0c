//! Every element of every data block, compared with the table.
