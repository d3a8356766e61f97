"""What each page shows and takes; one file for a page."""
