"""What the experiments of the paper share: sizes, pours that are kept, rows, figures, the page."""
