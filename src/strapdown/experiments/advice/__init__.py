"""Which loop for an IMU on a mission: a study, a stated rule, the answer and its page."""
