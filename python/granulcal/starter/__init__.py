"""What a newcomer begins with: a folder of commented files, and recordings of a known truth."""
