"""What a central planner would do: yardsticks for the auctions. One per file."""
