"""What a method is, the catalogue of them, their settings, and the rule that selects one."""
