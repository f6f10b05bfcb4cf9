"""What this installation computes against what is known: closed forms and published values, each by the public path."""
