"""Model the rotor as hinges and bodies of the MuJoCo engine, from raw scene data only."""
