pub mod body;
pub mod damage;
