"""Pours of the loop: scenes under conditions, the archive of all, and what is measured of them."""
