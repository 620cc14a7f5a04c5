"""Many simulated runs of several filters: studies in resumable campaigns, their summaries, and
advice that rests on them."""
