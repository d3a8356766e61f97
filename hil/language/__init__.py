"""Pages in the reader's language: gettext catalogues, and numbers with the locale's decimal sign."""
