"""What tests share: scenes, stored results, runs, oracles. Holds no test."""
