"""What a verdict has to stand: fresh pours, coverage, the rows that need no physics."""
