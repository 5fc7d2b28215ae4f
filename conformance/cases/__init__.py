"""How the corpus is made: families of questions, hard cases by number, certification."""
