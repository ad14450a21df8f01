"""Images, videos and Rerun logs of measurements and estimates."""
