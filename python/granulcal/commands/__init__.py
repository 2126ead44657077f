"""Commands of `granulcal`, one file each; what they do stands in the library."""
