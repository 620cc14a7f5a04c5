"""The one loop that runs any filter over samples and measurements, stage by stage, and the contract of what it calls."""
