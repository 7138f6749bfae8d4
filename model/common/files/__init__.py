"""Files written beside and renamed, temporary ones, the state folder."""
