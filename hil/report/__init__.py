"""Pages: self-contained HTML for the screen and for paper, without network and without script."""
